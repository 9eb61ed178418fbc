"""A model survives being printed and read, and being written as JSON and read."""

from __future__ import annotations

import json

import pytest
from hypothesis import HealthCheck, given, settings
from skill_language_strategies import skillsets

from skill_language import paper, rl
from skill_language.errors import LanguageError
from skill_language.json_form import from_json, to_json
from skill_language.model import Assignment, Comparison, DataIs, Effect, Event, Precondition, Result, ResultKind, Skill, Skillset
from skill_language.notation import Notation
from skill_language.printer import NotInThisNotationError, print_skillset

SLOW = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])


PARSE = {Notation.PAPER: paper.parse, Notation.ROBOT_LANGUAGE: rl.parse}
BOTH = (Notation.PAPER, Notation.ROBOT_LANGUAGE)


@SLOW
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


@SLOW
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


NOT = '{"is": "not", "operand": '
SKILL = '{"name": "s", "skills": [{"name": "f", %s}]}'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "Expecting value"),
        ("[]", "skillset should be an object, not []"),
        ('{"name": 3}', "skillset.name should be str, not 3"),
        ("{}", "skillset should be an object with `name`"),
        ('{"name": "s", "colour": 1}', "skillset should be an object with the fields name, types"),
        (SKILL % '"progress": {"period_s": true}', "skillset.skills[0].progress.period_s should be float, not True"),
        (SKILL % '"progress": {"period_s": NaN}', "period_s should be float, not nan"),
        (SKILL % '"results": [{"name": "R", "kind": "x"}]', "one of result, success, failure"),
        (SKILL % '"preconditions": [{"name": "p", "condition": {"is": []}}]', 'a condition with "is" one of'),
        (SKILL % '"inputs": 3', "skillset.skills[0].inputs should be a list, not 3"),
        ("[" * 100_000, "nested too deeply"),
        (SKILL % ('"start": ' + '{"name": "e", "assignments": 1}'), "start.assignments should be a list"),
        (SKILL % f'"preconditions": [{{"name": "p", "condition": {NOT * 300}1{"}" * 301}]', "nested less deeply"),
    ],
)
def test_json_that_is_no_model(text, told):
    with pytest.raises(LanguageError) as caught:
        from_json(text)
    (finding,) = caught.value.diagnostics
    assert finding.code == "ALU004"
    assert told in finding.message
