"""A model survives being printed and read, and being written as JSON and read."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from language_strategies import skillsets

from alula.language import paper, rl
from alula.language.notation import Notation
from alula.language.printer import NotInThisNotationError, print_skillset
from alula.model.expressions import Comparison, DataIs
from alula.model.json_form import from_json, to_json
from alula.model.model import Assignment, Effect, Event, Precondition, Result, ResultKind, Skill, Skillset

FEW = settings(max_examples=80)


PARSE = {Notation.PAPER: paper.parse, Notation.ROBOT_LANGUAGE: rl.parse}
BOTH = (Notation.PAPER, Notation.ROBOT_LANGUAGE)


@FEW
@given(skillsets)
def test_what_is_printed_reads_back_in_each_notation_and_through_both(skillset):
    for first, second in ((a, b) for a in BOTH for b in BOTH):
        text = print_skillset(skillset, first)
        there = PARSE[first](text, "x")
        assert there == skillset
        # `==` takes 1.0 for True; their texts differ.
        assert repr_without_places(there) == repr_without_places(skillset)
        assert print_skillset(there, first) == text
        back = PARSE[second](print_skillset(there, second), "x")
        assert repr_without_places(back) == repr_without_places(skillset)


@FEW
@given(skillsets)
def test_json_reads_back(skillset):
    text = to_json(skillset)
    assert repr_without_places(from_json(text)) == repr_without_places(skillset)
    assert to_json(from_json(text)) == text
    assert "span" not in json.loads(text)


def repr_without_places(skillset):
    return repr(json.loads(to_json(skillset)))


def test_json_keeps_what_only_the_other_notation_says():
    condition = DataIs("d", (), Comparison.EQ, value=True)
    skill = Skill("f", preconditions=(Precondition("p", condition),), results=(Result("R", ResultKind.FAILURE),))
    skillset = Skillset("s", events=(Event("e"),), skills=(skill,))
    again = from_json(to_json(skillset))
    assert again == skillset
    assert again.skills[0].preconditions[0].condition.value is True


@pytest.mark.parametrize("notation", BOTH)
def test_what_no_text_says_is_refused(notation):
    skill = Skill("f", start=Effect("take", (Assignment("r", "S"),)))
    with pytest.raises(NotInThisNotationError, match="skill f has no effect take"):
        print_skillset(Skillset("s", skills=(skill,)), notation)
    with pytest.raises(NotInThisNotationError, match="effect of event e can't have a name"):
        print_skillset(Skillset("s", events=(Event("e", effect=Effect("n")),)), notation)
