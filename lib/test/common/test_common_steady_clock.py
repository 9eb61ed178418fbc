"""The wall clock without its steps: none of the wall clock moves it, and stamps are wall time all the same."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from alula.common.steady_clock import CLOSE_NS, STEP_NS, SteadyClock

HOUR_NS = 3600 * 10**9
STEPS = st.lists(st.tuples(st.integers(0, HOUR_NS), st.integers(-2 * HOUR_NS, 2 * HOUR_NS)), max_size=8)


class Computer:
    """A monotonic clock, and a wall clock that can be set; reading either takes a moment."""

    def __init__(self, reading_ns=0):
        self.up_ns, self.set_ns, self._reading_ns = 5 * 10**9, 0, reading_ns

    def steady_ns(self):
        self.up_ns += self._reading_ns
        return self.up_ns

    def wall_ns(self):
        self.up_ns += self._reading_ns
        return 10**18 + self.up_ns + self.set_ns


def clock_of(computer):
    return SteadyClock(computer.wall_ns, computer.steady_ns)


@given(steps=STEPS)
def test_the_mission_clock_goes_on_evenly_whatever_is_done_to_the_wall_clock(steps):
    computer = Computer()
    clock = clock_of(computer)
    begun_ns = clock.now_ns()
    assert begun_ns == computer.wall_ns(), "it begins as the wall clock"
    for passed_ns, by_ns in steps:
        before_ns = clock.now_ns()
        computer.up_ns, computer.set_ns = computer.up_ns + passed_ns, computer.set_ns + by_ns
        assert clock.now_ns() - before_ns == passed_ns


@given(steps=STEPS)
def test_stamps_are_wall_time_and_tell_their_moment_again(steps):
    computer = Computer()
    clock = clock_of(computer)
    for passed_ns, by_ns in [*steps, (0, 0)]:
        computer.up_ns, computer.set_ns = computer.up_ns + passed_ns, computer.set_ns + by_ns
        moment_ns = clock.now_ns()
        stamp_ns = clock.stamp_ns(moment_ns)
        assert abs(stamp_ns - computer.wall_ns()) <= STEP_NS
        assert clock.moment_ns(stamp_ns) == moment_ns
        assert clock.steady_ns(moment_ns) == computer.up_ns


def test_a_clock_that_nobody_sets_has_one_time_and_no_time_stays_none():
    clock = clock_of(Computer())
    assert (clock.stamp_ns(123), clock.moment_ns(123), clock.moment_ns(0)) == (123, 123, 0)


def test_a_thread_that_is_interrupted_between_two_readings_sees_no_step():
    computer = Computer()
    clock = clock_of(computer)
    readings = iter([HOUR_NS])
    wall_ns = computer.wall_ns

    def interrupted():
        told_ns = wall_ns()
        computer.up_ns += next(readings, 0)  # another thread has the processor for an hour, once
        return told_ns

    clock._wall_ns = interrupted
    assert clock.set_ns == 0
    assert next(readings, None) is None, "it was interrupted"


def test_a_slow_reading_is_no_offset():
    computer = Computer(reading_ns=10 * CLOSE_NS)
    assert abs(clock_of(computer).set_ns) < STEP_NS
