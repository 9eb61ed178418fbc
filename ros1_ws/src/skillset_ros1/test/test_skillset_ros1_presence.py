"""Signs of life, doubt and certainty, without ROS."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill_runtime.core.errors import SkillRuntimeError
from skillset_ros1.presence import BROKEN_LEASE_S, DOUBT_S, LEASE_S, Presence, Verdict


def heard_at_0() -> Presence:
    presence = Presence()
    assert presence.heard("one", 0.0)
    return presence


def test_silence_is_doubted_and_then_certain():
    presence = heard_at_0()
    assert presence.check(LEASE_S, connected=True) is Verdict.NOTHING
    assert presence.check(LEASE_S + 0.1, connected=True) is Verdict.ASK
    assert presence.check(LEASE_S + 0.1 + DOUBT_S, connected=True) is Verdict.NOTHING
    assert presence.alive
    assert presence.check(LEASE_S + 0.2 + DOUBT_S, connected=True) is Verdict.GONE
    assert not presence.alive
    assert presence.check(100.0, connected=True) is Verdict.NOTHING


def test_a_broken_connection_is_doubted_sooner():
    presence = heard_at_0()
    assert presence.check(BROKEN_LEASE_S, connected=False) is Verdict.NOTHING
    assert presence.check(BROKEN_LEASE_S + 0.1, connected=False) is Verdict.ASK


@pytest.mark.parametrize("sign", [lambda presence, now: presence.answered(now), lambda presence, now: presence.heard("one", now)])
def test_a_sign_ends_the_doubt(sign):
    presence = heard_at_0()
    assert presence.check(3.0, connected=True) is Verdict.ASK
    sign(presence, 3.5)
    assert presence.check(3.5 + LEASE_S, connected=True) is Verdict.NOTHING
    assert presence.check(3.6 + LEASE_S, connected=True) is Verdict.ASK


def test_others_take_the_place_and_late_signs_of_the_first_count_no_more():
    presence = heard_at_0()
    assert presence.heard("two", 1.0)
    assert not presence.heard("one", 1.1)
    assert presence.life == "two"
    with pytest.raises(SkillRuntimeError, match="without a name"):
        presence.heard("", 1.2)


@given(st.lists(st.tuples(st.floats(0.01, 3.0), st.sampled_from(["heard", "answered", "check"]), st.booleans()), max_size=40))
def test_nobody_is_given_up_who_gave_a_sign_within_the_shortest_lease(steps):
    presence, now, sign = heard_at_0(), 0.0, 0.0
    for pause, what, connected in steps:
        now += pause
        if what == "heard":
            presence.heard("one", now)
            sign = now
        elif what == "answered":
            presence.answered(now)
        elif presence.check(now, connected=connected) is Verdict.GONE:
            assert now - sign > BROKEN_LEASE_S + DOUBT_S
