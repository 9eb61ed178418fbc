"""Times on the mission clock: of the guidance's steps, and of what the autopilot measured, without the jitter of the arrival."""

from __future__ import annotations

from collections import deque
from statistics import median_low
from threading import Condition

WINDOW = 250
JUMP_NS = 500_000_000
SMOOTHING = 0.1
PERIOD_NS = 50_000_000  # of the guidance's steps


class FineClock:
    """Read a coarse clock between its ticks: /clock has steps of 20 ms, and the autopilot's messages come before or after a step.

    How much of a step has passed is told by the wall time since the last one, compared with what steps usually take. A clock that
    is held (the simulator waits for a node) does not run on: it stands just before its next step.
    """

    def __init__(self) -> None:
        self._tick_ns: int | None = None
        self._tick_wall_ns = 0
        self._step_ns = 0
        self._usual_wall_ns = 0.0

    def tick(self, clock_ns: int, wall_ns: int) -> None:
        """Record a step of the clock, and the time of a monotonic one at its arrival."""
        if self._tick_ns is None or clock_ns <= self._tick_ns:
            self._step_ns, self._usual_wall_ns = 0, 0.0
        else:
            took_ns = wall_ns - self._tick_wall_ns
            self._usual_wall_ns += (took_ns - self._usual_wall_ns) * (SMOOTHING if self._usual_wall_ns else 1.0)
            self._step_ns = clock_ns - self._tick_ns
        self._tick_ns, self._tick_wall_ns = clock_ns, wall_ns

    def now_ns(self, wall_ns: int) -> int | None:
        """Return the time between the last step and the next one; None before the first."""
        if self._tick_ns is None or self._usual_wall_ns <= 0.0:
            return self._tick_ns
        passed = min((wall_ns - self._tick_wall_ns) / self._usual_wall_ns, 1.0)
        return self._tick_ns + int(max(passed, 0.0) * self._step_ns)


class Alarm:
    """Wakes a thread at a moment of a clock that another thread ticks; ``rospy.sleep`` wakes its caller at each tick."""

    def __init__(self) -> None:
        self._ticked = Condition()
        self._now_ns = self._due_ns = 0
        self._set_back = False

    def tick(self, now_ns: int) -> None:
        """Set the time."""
        with self._ticked:
            self._set_back |= now_ns < self._now_ns
            self._now_ns = now_ns
            if self._over:
                self._ticked.notify()

    def wait(self, due_ns: int, timeout_s: float) -> bool:
        """Wait for a moment, or until the clock is set back, at most ``timeout_s`` of wall clock; return whether the wait is over."""
        with self._ticked:
            self._due_ns = due_ns
            over = self._ticked.wait_for(lambda: self._over, timeout_s)
            self._set_back &= not over
            return over

    @property
    def _over(self) -> bool:
        return self._set_back or self._now_ns >= self._due_ns


class Steps:
    """When steps of the guidance are due, nanoseconds of the mission clock; a clock that was set back is followed."""

    def __init__(self, begin_ns: int) -> None:
        self.due_ns = begin_ns

    def made(self, now_ns: int) -> bool:
        """Record a step, and the time after it; return whether no step is due by now, so that all is done up to now.

        Steps that were missed meanwhile are left out. Then the next may be due later than a clock comes that is held until what was due
        is done: not the time of the step is to be told for that, but the time after it.
        """
        missed = max(-((self.due_ns - now_ns) // PERIOD_NS), 1)
        self.due_ns = min(self.due_ns + missed * PERIOD_NS, now_ns + PERIOD_NS)
        return self.due_ns > now_ns


class StampClock:
    """Turn the autopilot's milliseconds since boot into the mission clock.

    The offset between the clocks is the median of the last arrivals (5 s at 50 Hz; two crystals drift apart by 0.5 ms in that time), so
    that messages that were held up, or a clock that was, change nothing. Stamps always grow.
    """

    def __init__(self) -> None:
        self._offsets_ns: deque[int] = deque(maxlen=WINDOW)
        self._median_ns = 0
        self._last_ns = 0

    def stamp_ns(self, boot_ms: int, arrival_ns: int) -> int | None:
        """Return the time of measurement in ns of the mission clock; None if it is not later than the one before."""
        offset_ns = arrival_ns - boot_ms * 1_000_000
        if self._offsets_ns and abs(offset_ns - self._median_ns) > JUMP_NS:
            # One of the two clocks was set or restarted.
            self._offsets_ns.clear()
            self._last_ns = 0
        self._offsets_ns.append(offset_ns)
        self._median_ns = median_low(self._offsets_ns)
        stamp_ns = boot_ms * 1_000_000 + self._median_ns
        if stamp_ns <= self._last_ns:
            return None
        self._last_ns = stamp_ns
        return stamp_ns
