"""Does a measurement's stamp fit the moment of its arrival?"""

from __future__ import annotations

from dataclasses import dataclass

from perception_core.health import FINE, FaultKind, Finding, broken
from perception_core.poses import NS


@dataclass(frozen=True)
class StampLimits:
    """Seconds of mission clock.

    ``latency_s`` is what the driver is known to need from the measurement to its arrival; a measurement may be older than that by
    ``max_delay_s``. ``future_s``: clocks of two machines never agree quite.
    """

    latency_s: float = 0.0
    max_delay_s: float = 0.35
    future_s: float = 0.1


CLOCKS = "the sensor's clock is not that of this computer", "the driver stamps wrongly"
SLOW = "the computer or the connection is too slow", "the sensor's clock is behind"
MEND_SHARE = 0.8  # of max_delay_s: once too late, a sensor must be clearly in time again, or its health would flap at the limit


class StampJudge:
    """Judge stamps in the order of their arrival; not thread-safe."""

    def __init__(self, limits: StampLimits) -> None:
        self.limits = limits
        self._previous_ns = -1
        self._late = False

    def finding(self, stamp_ns: int, now_ns: int) -> Finding:
        """Return the finding about a stamp at the moment ``now_ns`` of its arrival."""
        previous_ns, self._previous_ns = self._previous_ns, stamp_ns
        delay_s = (now_ns - stamp_ns) / NS - self.limits.latency_s
        share = MEND_SHARE if self._late else 1.0
        self._late = delay_s > share * self.limits.max_delay_s
        if delay_s < -self.limits.future_s - self.limits.latency_s:
            return broken(FaultKind.STAMP, f"the stamp is {-delay_s - self.limits.latency_s:.2f} s in the future", *CLOCKS)
        if self._late:
            told = f", {self.limits.latency_s:g} s of which are its known latency" if self.limits.latency_s else ""
            return broken(FaultKind.STAMP, f"the measurement is {delay_s + self.limits.latency_s:.2f} s old when it arrives{told}", *SLOW)
        if stamp_ns <= previous_ns:
            return broken(FaultKind.STAMP, "the stamp does not advance", "the driver repeats a measurement", "its clock stands")
        return FINE
