"""The clock by which a silence is measured: monotonic on a robot; ``/clock`` in simulation, where a slow machine is no silence."""

from __future__ import annotations

import time

import rospy

SIMULATED_LOOK_S = 0.05
"""Wall clock; simulated time may pass faster than it, so who waits for a moment of it looks so often."""


def is_simulated() -> bool:
    """Tell whether ROS has simulated time."""
    return not rospy.rostime.is_wallclock()


def now_s() -> float:
    """Return the time in seconds; its zero means nothing."""
    return rospy.get_time() if is_simulated() else time.monotonic()
