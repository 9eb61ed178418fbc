"""Names for what trees call by any text."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.adopt.naming import Names
from alula.language.load import parse_skillset
from alula.model.ros_types import camel, is_field_name

SLIPS = [
    "class",
    "Result",
    "and",
    "None",
    "A",
    "a",
    "a_",
    "_a",
    "1",
    "ä",
    "ö",
    "目标",
    "MoveTo",
    "move_to",
    "movE to",
    "self",
    "state",
    "x__y",
]
TEXTS = st.lists(st.one_of(st.text(max_size=12), st.sampled_from(SLIPS)), min_size=1, max_size=8)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("MoveTo", "move_to"),
        ("HTTPServer2Go", "http_server2_go"),
        ("Look at table", "look_at_table"),
        ("rover.goto", "rover_goto"),
        ("Öffne", "offne"),
        ("3D", "node_3_d"),
        ("目标", "node"),
        ("class", "class_node"),
        ("Result", "result_node"),
        ("True", "true_node"),
    ],
)
def test_a_name_is_in_lower_case_with_underscores(text, name):
    assert Names("node").add(text) == name


def test_a_name_that_is_taken_gets_a_number_also_where_only_case_or_underscores_differ():
    names = Names("node", ["shared"])
    assert [names.add(text) for text in ("MoveTo", "moveTo", "Moveto", "shared")] == ["move_to", "move_to_2", "moveto_3", "shared_2"]


@given(TEXTS)
def test_names_are_fields_of_messages_differ_in_camel_case_and_fit_a_model(texts):
    names = Names("port")
    first, *others = added = [names.add(text) for text in texts]
    assert all(map(is_field_name, added))
    assert len(set(map(camel, added))) == len(texts)
    ports = "".join(f" {name}: string" for name in others)
    inputs = f"input {{{ports} }}" if others else ""
    skillset = parse_skillset(f"skillset rover {{ skill {first} {{ {inputs} result {{ success SUCCESS failure FAILURE }} }} }}")
    assert [one.name for one in skillset.skill(first).inputs] == others
