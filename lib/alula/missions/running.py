"""Runs a mission to its end on the wall clock, whatever becomes of the mission clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from alula.missions.director import MissionResult, Outcome
from alula.missions.driver import MissionDriver

STANDS_S = 60.0
"""A mission clock that stands still for so long (wall clock) does not go on."""
STOP_S = 30.0
"""How long (wall clock) what stops the robot may take while the mission clock stands still."""
LAST_EVENTS_S = 2.0
"""How long (wall clock) the events of what has ended are waited for."""
STANDS = "the mission clock stands still (what gives it hangs, or the bridge that brings it)"


class Standstill:
    """Notices that the mission clock stands still, on the wall clock."""

    def __init__(self, timeout_s: float, wall_s: Callable[[], float]) -> None:
        self._timeout_s = timeout_s
        self._wall_s = wall_s
        self._last = 0.0
        self._since = wall_s()

    def lasts(self, now_s: float) -> bool:
        """Return whether the mission clock has stood still for longer than the timeout."""
        if now_s != self._last:
            self._last, self._since = now_s, self._wall_s()
        return self._wall_s() - self._since > self._timeout_s


def run_to_the_end(
    driver: MissionDriver,
    turn: Callable[[], None],
    now_s: Callable[[], float],
    wall_s: Callable[[], float] = time.monotonic,
) -> MissionResult:
    """Take turns until the mission is over; return how it ended.

    Args:
        driver: the mission's.
        turn: waits a moment for what comes from outside, takes it, and does a tick that is due.
        now_s: the mission clock.
        wall_s: the wall clock.
    """
    standstill = Standstill(STANDS_S, wall_s)
    while driver.end is None and not standstill.lasts(now_s()):
        turn()
    end = driver.end or _stopped(driver, turn, wall_s)
    last_s = wall_s() + LAST_EVENTS_S
    while not driver.settled and wall_s() < last_s:
        turn()
    return end


def _stopped(driver: MissionDriver, turn: Callable[[], None], wall_s: Callable[[], float]) -> MissionResult:
    """Interrupt what runs and bring the robot to rest as far as that takes no time of a clock that stands still."""
    if driver.director.start_s is None:
        return MissionResult(Outcome.NOT_STARTED, STANDS)
    driver.abort(STANDS)
    end_s = wall_s() + STOP_S
    while driver.end is None and wall_s() < end_s:
        driver.wake()  # no timer of the mission clock does
        turn()
    return MissionResult(Outcome.ABORTED, driver.end.reason if driver.end else f"{STANDS}; the robot was not at rest within {STOP_S:g} s")
