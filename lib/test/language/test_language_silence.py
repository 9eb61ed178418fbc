"""A resource that is known only as long as its reporter is heard of: what `silence` stands for, in both notations."""

from __future__ import annotations

import pytest

from alula.language.load import parse_skillset
from alula.model.json_form import from_json, to_json
from alula.model.model import Transition

PAPER = """skillset s {
  resource eye { initial UNKNOWN silence = 2.0 extern UNKNOWN -> OPEN extern UNKNOWN -> SHUT extern OPEN -> SHUT SHUT -> OPEN }
  skill look {
    precondition { open: resource = (eye == OPEN) }
    invariant { stays: resource = (eye == OPEN) alone: resource = (eye == OPEN or eye == UNKNOWN) }
    result { SEEN }
  }
}"""
RL = """skillset s {
  resource eye {
    state { UNKNOWN OPEN SHUT }
    initial UNKNOWN
    silence 2000 ms
    transition { extern UNKNOWN -> OPEN  extern UNKNOWN -> SHUT  extern OPEN -> SHUT  SHUT -> OPEN }
  }
}"""


@pytest.mark.parametrize(("text", "name"), [(PAPER, "s.skill"), (RL, "s.rl")], ids=["paper", "rl"])
def test_it_stands_for_an_extern_transition_from_each_state_to_the_initial_one(text, name):
    skillset = parse_skillset(text, name)
    eye = skillset.resource("eye")
    assert eye.silence_s == 2.0
    assert eye.transitions[-2:] == (Transition("OPEN", "UNKNOWN", extern=True), Transition("SHUT", "UNKNOWN", extern=True))
    assert len(eye.transitions) == 6
    assert from_json(to_json(skillset)).resource("eye") == eye


def test_a_state_may_have_the_words_name():
    skillset = parse_skillset("skillset s { resource r { initial silence silence -> loud loud -> silence } }")
    assert (skillset.resource("r").states, skillset.resource("r").silence_s) == (("silence", "loud"), None)
