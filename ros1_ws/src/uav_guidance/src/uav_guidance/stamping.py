"""When a message was measured: the autopilot's own clock, set to the mission clock without the jitter of the arrival."""

from __future__ import annotations

from collections import deque
from statistics import median_low

WINDOW = 25
JUMP_NS = 500_000_000


class StampClock:
    """Turn the autopilot's milliseconds since boot into the mission clock.

    The offset between the clocks is the median of the last arrivals (half a second at 50 Hz), so that a message that was held up, or
    that came just before a tick of a coarse clock, still gets the time at which it was measured. Stamps always grow.
    """

    def __init__(self) -> None:
        self._offsets_ns: deque[int] = deque(maxlen=WINDOW)
        self._last_ns = 0

    def stamp_ns(self, boot_ms: int, arrival_ns: int) -> int | None:
        """Return the time of measurement in ns of the mission clock; None if it is not later than the one before."""
        offset_ns = arrival_ns - boot_ms * 1_000_000
        if self._offsets_ns and abs(offset_ns - median_low(self._offsets_ns)) > JUMP_NS:
            # One of the two clocks was set or started anew.
            self._offsets_ns.clear()
            self._last_ns = 0
        self._offsets_ns.append(offset_ns)
        stamp_ns = boot_ms * 1_000_000 + median_low(self._offsets_ns)
        if stamp_ns <= self._last_ns:
            return None
        self._last_ns = stamp_ns
        return stamp_ns
