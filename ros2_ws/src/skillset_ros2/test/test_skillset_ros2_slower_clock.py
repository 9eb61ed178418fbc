"""The slower one of two clocks, from look to look."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from skillset_ros2 import SlowerClock

STEPS = st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 10.0)), min_size=2, max_size=50)


def passed_s(steps) -> float:
    """Return how long the clock says that steps of both clocks took, with a look after each."""
    at = SimpleNamespace(mission_s=50.0, steady_s=1000.0)
    clock = SlowerClock(lambda: at.mission_s, lambda: at.steady_s)
    assert clock.now_s == 0.0
    for mission_s, steady_s in steps:
        at.mission_s, at.steady_s = at.mission_s + mission_s, at.steady_s + steady_s
        before_s = clock.now_s
        assert clock.now_s == before_s, "who reads it looks at nothing"
        assert clock.look() == clock.now_s >= before_s
    return clock.now_s


@given(STEPS)
def test_it_never_passes_faster_than_either(steps):
    mission_s, steady_s = (sum(one) for one in zip(*steps, strict=True))
    assert passed_s(steps) <= min(mission_s, steady_s) + 1e-6


@given(st.floats(0.01, 10.0), st.floats(0.01, 10.0), st.integers(1, 50))
def test_where_both_pass_evenly_it_is_the_slower_one(mission_s, steady_s, count):
    assert passed_s([(mission_s, steady_s)] * count) == pytest.approx(count * min(mission_s, steady_s), abs=1e-6)


def test_a_simulation_that_jumps_stands_or_begins_anew_is_no_time():
    assert passed_s([(400.0, 0.05), (0.0, 3.0), (-50.0, 1.0), (1.0, 1.0)]) == pytest.approx(1.05)
