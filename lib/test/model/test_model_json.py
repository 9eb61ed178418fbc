"""What the JSON reader refuses; that what was written is read again is tested with the language's strategies."""

from __future__ import annotations

import re

import pytest

from alula.model.errors import ModelFormatError
from alula.model.json_form import from_json

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
    with pytest.raises(ModelFormatError, match=re.escape(told)):
        from_json(text)
