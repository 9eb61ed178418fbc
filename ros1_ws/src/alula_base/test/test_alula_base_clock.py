"""The clock of a simulation: the slower one of two, from look to look."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rospy")

from alula_base.clock import SlowerClock

STEPS = st.lists(st.tuples(st.floats(0.0, 10.0), st.floats(0.0, 10.0)), min_size=2, max_size=50)


def passed_s(steps) -> float:
    """Return how long the clock says that it took, from the first look on; each step is of both clocks."""
    clock, wall_s, simulated_s = SlowerClock(), 1000.0, 0.0
    begin_s = clock.look(wall_s, simulated_s)
    for wall, simulated in steps:
        wall_s, simulated_s = wall_s + wall, simulated_s + simulated
        now_s = clock.look(wall_s, simulated_s)
    return now_s - begin_s


@given(STEPS)
def test_it_never_passes_faster_than_either(steps):
    wall_s, simulated_s = (sum(one) for one in zip(*steps, strict=True))
    assert -1e-6 <= passed_s(steps) <= min(wall_s, simulated_s) + 1e-6


@given(st.floats(0.01, 10.0), st.floats(0.01, 10.0), st.integers(1, 50))
def test_where_both_pass_evenly_it_is_the_slower_one(wall_s, simulated_s, count):
    assert passed_s([(wall_s, simulated_s)] * count) == pytest.approx(count * min(wall_s, simulated_s), abs=1e-6)


def test_a_simulation_that_jumps_or_stands_is_no_time():
    assert passed_s([(0.05, 400.0), (3.0, 0.0)]) == pytest.approx(0.05)


def test_a_simulation_that_begins_anew_takes_nothing_back():
    assert passed_s([(1.0, 1.0), (1.0, -50.0), (1.0, 1.0)]) == pytest.approx(2.0)
