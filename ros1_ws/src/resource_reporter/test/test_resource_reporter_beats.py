"""Beats come by whichever clock passes first."""

from __future__ import annotations

import pytest

pytest.importorskip("rospy")

from resource_reporter.beats import PeriodOnEither


def test_a_period_has_passed_at_the_start():
    assert PeriodOnEither(0.5).wait_s(7.0, 100.0) == 0.0


@pytest.mark.parametrize(
    ("steady_s", "ros_s", "due"),
    [
        (7.4, 100.0, False),
        (7.5, 100.0, True),  # a simulation that stands, or whose simulator is suspended
        (7.5, 100.1, True),  # one that takes five seconds for one
        (7.1, 100.5, True),  # one that runs ahead
        (7.1, 3.0, True),  # one that has begun anew
    ],
)
def test_a_period_passes_on_either_clock(steady_s, ros_s, due):
    period = PeriodOnEither(0.5)
    assert period.wait_s(7.0, 100.0) == 0.0
    wait_s = period.wait_s(steady_s, ros_s)
    assert wait_s == (0.0 if due else pytest.approx(7.5 - steady_s))
    if due:
        assert period.wait_s(steady_s, ros_s) == 0.5, "the next one has begun"
