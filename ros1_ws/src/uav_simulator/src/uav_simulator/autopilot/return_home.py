"""RTL: climb, go home, wait above it, descend."""

from __future__ import annotations

import math

from uav_simulator.autopilot.navigator import Goal
from uav_simulator.autopilot.params import Parameters
from uav_simulator.frames import Vec3

CLIMBED_M, ARRIVED_M = 0.2, 0.5


class ReturnHome:
    """One return; made when RTL is entered."""

    def __init__(self, params: Parameters, goal: Goal, position: Vec3, home: Vec3) -> None:
        self._params, self._home = params, home
        self._height_m = max(position[2], home[2] + params["RTL_ALT"] / 100.0)
        self._above_home_s: float | None = None
        goal.z = self._height_m

    @property
    def landing(self) -> bool:
        """Return whether home is reached, so that what is left is to land."""
        return self._above_home_s is not None

    def step(self, now_s: float, position: Vec3, goal: Goal) -> bool:
        """Move the goal on; return whether it is time to descend."""
        if self._above_home_s is not None:
            return now_s - self._above_home_s > self._params["RTL_LOIT_TIME"] / 1000.0
        if position[2] > self._height_m - CLIMBED_M:
            goal.xy = (self._home[0], self._home[1])
            if math.dist(position[:2], self._home[:2]) < ARRIVED_M:
                self._above_home_s = now_s
        return False
