"""Stamps of another computer, whose clock is another: what its heartbeats tell of it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.common.steady_clock import SteadyClock
from alula.runtime.mission_clock import FEWEST, HEARTBEATS, JUMP_NS, NEAR_NS, SET_AFTER, MissionClock

BEAT_NS, HOUR_NS = 500_000_000, 3600 * 10**9
DELAYS = st.lists(st.integers(0, NEAR_NS), min_size=FEWEST, max_size=3 * HEARTBEATS)


class Two:
    """Our computer and another one, whose clock is behind by ``behind_ns``; our wall clock is set now and then."""

    def __init__(self, behind_ns=0, *, simulated=False):
        self.now_ns, self.behind_ns, self.set_ns = 10**18, behind_ns, 0
        steady = SteadyClock(lambda: self.now_ns + self.set_ns, lambda: self.now_ns)
        self.clock = MissionClock(lambda: simulated, lambda: self.now_ns, steady)

    def beat(self, delay_ns=0):
        sent_ns = self.now_ns + self.set_ns - self.behind_ns
        self.now_ns += delay_ns
        self.clock.hear(sent_ns)
        self.now_ns += BEAT_NS

    def error_ns(self):
        """How wrong a stamp of now is that the other computer has made."""
        return abs(self.clock.moment_ns(self.now_ns + self.set_ns - self.behind_ns) - self.now_ns)


@given(behind_ns=st.integers(-2 * HOUR_NS, 2 * HOUR_NS), delays=DELAYS)
def test_stamps_of_another_computer_are_right_to_some_delay_of_a_message(behind_ns, delays):
    two = Two(behind_ns)
    for delay_ns in delays:
        two.beat(delay_ns)
    assert two.error_ns() <= 2 * NEAR_NS


@given(delays=DELAYS)
def test_those_of_the_same_clock_are_left_as_they_are(delays):
    two = Two()
    for delay_ns in delays:
        two.beat(delay_ns)
    assert two.error_ns() == 0


def test_a_heartbeat_that_was_latched_for_long_tells_nothing():
    two = Two()
    two.beat(20 * BEAT_NS)
    assert two.error_ns() == 0
    two.beat()
    assert two.error_ns() == 0


@pytest.mark.parametrize("by_ns", [HOUR_NS, -HOUR_NS])
def test_a_clock_that_is_set_there_is_followed(by_ns):
    two = Two()
    for _ in range(HEARTBEATS):
        two.beat(1_000_000)
    two.behind_ns = by_ns
    for _ in range(SET_AFTER):
        two.beat(1_000_000)
    assert two.error_ns() <= NEAR_NS


def test_one_that_comes_late_is_no_other_clock():
    two = Two()
    for delay_ns in (0, 0, 2 * JUMP_NS, 2 * JUMP_NS, 0):
        two.beat(delay_ns)
        assert two.error_ns() == 0


@given(set_ns=st.integers(-2 * HOUR_NS, 2 * HOUR_NS))
def test_our_own_clock_may_be_set_and_no_time_stays_none(set_ns):
    two = Two(behind_ns=3 * 10**9)
    for _ in range(FEWEST):
        two.beat()
    two.set_ns = set_ns
    two.behind_ns += set_ns  # theirs was not
    for _ in range(HEARTBEATS):
        two.beat()
    assert two.error_ns() <= NEAR_NS
    assert two.clock.moment_ns(0) == 0


def test_simulated_time_is_one_for_all_computers():
    two = Two(HOUR_NS, simulated=True)
    for _ in range(HEARTBEATS):
        two.beat()
    assert two.clock.moment_ns(123) == 123
