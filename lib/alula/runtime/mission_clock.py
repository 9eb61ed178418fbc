"""The mission clock of an adapter, and the stamps of its messages."""

from __future__ import annotations

from collections.abc import Callable

from alula.common.steady_clock import STEADY_CLOCK, SteadyClock


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

    @property
    def simulated(self) -> bool:
        """Tell whether it is ``/clock``."""
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
        """Return the moment that a message's stamp tells; 0, no time, stays 0."""
        return stamp_ns and stamp_ns - self.set_ns
