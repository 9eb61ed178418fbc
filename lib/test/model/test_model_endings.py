"""What a result means is said by the model alone: the same results under any names have the same meaning, everywhere."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.campaign.failures import RESULT, ways_to_fail
from alula.language.paper import parse
from alula.mock.behaviour import default_script
from alula.model.execution_state import ExecutionState as S
from alula.model.model import Result, ResultKind, Skill, Skillset
from alula.records.causes.failures import skill_failures
from alula.runtime.core.events import ExecutionEvent, event_record, read_event

PLAIN, SUCCESS, FAILURE = ResultKind.PLAIN, ResultKind.SUCCESS, ResultKind.FAILURE
NAMES = ["UNLOCKED", "BLOCKING", "UNBLOCKED", "FAILSAFE_OFF", "ABORTED", "ARRIVED", "CLEAR_OF_IT"]
"""Names that lists of words have taken for success here and for failure there."""


def test_in_the_papers_notation_the_first_result_is_the_success_and_the_others_are_failures():
    skill = parse("skillset s { skill f { result { AT_ALTITUDE BLOCKED ABORTED } } }", "s.skill").skill("f")
    assert [skill.kind_of(one.name) for one in skill.results] == [SUCCESS, FAILURE, FAILURE]
    assert [one.kind for one in skill.results] == [PLAIN] * 3, "it is read as printed"


@pytest.mark.parametrize(
    ("text", "kinds"),
    [
        ("result { failure LOST failure ABORTED }", [FAILURE, FAILURE]),
        ("result { BLOCKED success DONE }", [PLAIN, SUCCESS]),
        ("result { DONE failure BLOCKED }", [PLAIN, FAILURE]),
    ],
)
def test_where_a_result_is_called_a_success_or_a_failure_one_without_a_word_is_neither(text, kinds):
    skill = parse(f"skillset s {{ skill f {{ {text} }} }}", "s.skill").skill("f")
    assert [skill.kind_of(one.name) for one in skill.results] == kinds


def test_a_result_that_the_skill_has_not_has_no_kind():
    with pytest.raises(KeyError, match="skill f has no result OK; it has DONE"):
        Skill("f", results=(Result("DONE"),)).kind_of("OK")


RESULTS = st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(ResultKind)), min_size=1, max_size=4, unique_by=lambda one: one[0])


def meanings(skill: Skill) -> list[tuple[ResultKind, bool, bool, bool]]:
    """Return of each result: its kind, whether a mock ends with it, whether a campaign counts it, whether it is a failure in a record."""
    skillset = Skillset("s", skills=(skill,))
    ways = {way.name for way in ways_to_fail([skillset]) if way.kind == RESULT}
    mocked = {name for name, _ in default_script(skill).ending.results}
    found = []
    for result in skill.results:
        kind = skill.kind_of(result.name)
        end = ExecutionEvent(1, 0, "f", "1", S.TERMINATED, result.name, "", {}, {}, "s", kind)
        failed = bool(skill_failures([read_event(event_record(end))]))
        found.append((kind, result.name in mocked, f"s.f {result.name}" in ways, failed))
    return found


@given(RESULTS)
def test_no_name_decides_what_a_result_means(results):
    skill = Skill("f", results=tuple(Result(name, kind) for name, kind in results))
    renamed = replace(skill, results=tuple(replace(one, name=f"R{number}") for number, one in enumerate(skill.results)))
    found = meanings(skill)
    assert found == meanings(renamed)
    assert [(in_ways, failed) for _, _, in_ways, failed in found] == [(kind is FAILURE, kind is FAILURE) for kind, *_ in found]
    successes = [number for number, (kind, *_) in enumerate(found) if kind is SUCCESS]
    assert [number for number, (_, mocked, *_) in enumerate(found) if mocked] == successes[:1]
