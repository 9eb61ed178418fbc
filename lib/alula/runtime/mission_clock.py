"""The mission clock of an adapter, and the stamps of its messages."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from alula.common.steady_clock import STEADY_CLOCK, SteadyClock

NEAR_NS = 50_000_000
"""Clocks that are this near are taken for one: messages need some time, too."""
FEWEST, HEARTBEATS, SET_AFTER, JUMP_NS = 2, 20, 3, 1_000_000_000
"""The offset is the least of so many heartbeats, once there are a few: the first may have been latched for a while. Some that are all
further off, by that much, tell that the other clock was set meanwhile."""


class PeerOffset:
    """Measures by the stamps of its heartbeats how far the clock of another computer is behind ours.

    A message takes some time, so that each tells too much by as long as it took: the least counts.
    """

    def __init__(self) -> None:
        self._behind_ns: deque[int] = deque(maxlen=HEARTBEATS)

    def hear(self, behind_ns: int) -> None:
        """Take how old a heartbeat seems to be that has just come, nanoseconds; below 0: it is of the future."""
        told = self._behind_ns
        told.append(behind_ns)
        newest = list(told)[-SET_AFTER:]
        if len(newest) == SET_AFTER and min(newest) - min(told) > JUMP_NS:
            told.clear()
            told.extend(newest)

    @property
    def behind_ns(self) -> int:
        """How far it is behind, nanoseconds; 0 where it is near, or too little was heard."""
        least_ns = min(self._behind_ns) if len(self._behind_ns) >= FEWEST else 0
        return 0 if abs(least_ns) <= NEAR_NS else least_ns


class MissionClock:
    """``/clock`` where that is simulated, else the wall clock without its steps.

    Values of the port have moments of this clock, messages have stamps: ROS time, which is wall time where nothing simulates it.

    Args:
        simulated: tells whether ``/clock`` is taken; that may begin later.
        ros_time_ns: returns ROS time, nanoseconds.
        steady: the clock where there is no ``/clock``; of the process by default.
    """

    def __init__(self, simulated: Callable[[], bool], ros_time_ns: Callable[[], int], steady: SteadyClock = STEADY_CLOCK) -> None:
        self._simulated = simulated
        self._ros_time_ns = ros_time_ns
        self._steady = steady
        self._peer = PeerOffset()

    @property
    def simulated(self) -> bool:
        """Return whether it is ``/clock``."""
        return self._simulated()

    def now_ns(self) -> int:
        """Return it, nanoseconds."""
        return self._ros_time_ns() if self._simulated() else self._steady.now_ns()

    def steady_ns(self, moment_ns: int) -> int:
        """Return a moment of it as the monotonic clock has it, where it is not ``/clock``."""
        return self._steady.steady_ns(moment_ns)

    @property
    def set_ns(self) -> int:
        """By how much stamps are ahead of it, nanoseconds: the wall clock was set since the process began."""
        return 0 if self._simulated() else self._steady.set_ns

    def stamp_ns(self, moment_ns: int) -> int:
        """Return the stamp of a message for a moment, nanoseconds."""
        return moment_ns + self.set_ns

    def moment_ns(self, stamp_ns: int) -> int:
        """Return the moment that a message's stamp tells; 0, no time, stays 0.

        Of a computer whose clock is another, it is corrected by what its heartbeats have told.
        """
        return stamp_ns and stamp_ns - self.set_ns + (0 if self._simulated() else self._peer.behind_ns)

    def hear(self, stamp_ns: int) -> None:
        """Measure the clock of who sends the messages that are heard by a heartbeat that has just come."""
        if stamp_ns and not self._simulated():
            self._peer.hear(self._steady.now_ns() + self._steady.set_ns - stamp_ns)
