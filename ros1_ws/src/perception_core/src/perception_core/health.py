"""Is a sensor alive? A watch that is told of every measurement and asked for its verdict; no ROS, time is given in nanoseconds."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum

from perception_core.poses import NS

RATE_OVER_S = 2.0
LATE_TICK_S = 0.1


class Verdict(Enum):
    """What is known of the sensor; the values are the states of the skillset's resource."""

    UNKNOWN = "UNKNOWN"
    OK = "OK"
    BROKEN = "BROKEN"


@dataclass(frozen=True)
class HealthLimits:
    """Seconds of mission clock: without a good measurement until broken, of good ones until mended, of nothing at first until broken."""

    timeout_s: float = 0.35
    recover_s: float = 1.0
    start_s: float = 5.0


class HealthWatch:
    """Judge a stream of measurements by the age of the last good one.

    A bad measurement (black, frozen, empty) never breaks the sensor by itself: it does not count as good, so that one glitch passes and a
    lasting fault shows within ``timeout_s`` of the last good measurement. Not thread-safe: the caller serialises.
    """

    def __init__(self, limits: HealthLimits) -> None:
        self._limits = limits
        self._restart()

    def _restart(self) -> None:
        self.verdict = Verdict.UNKNOWN
        self.reason = "nothing received yet"
        self._started_ns: int | None = None
        self._last_tick_ns: int | None = None
        self._last_good_ns: int | None = None
        self._good_since_ns: int | None = None
        self._complaint = ""
        self._good_ns: deque[int] = deque()

    def good(self, stamp_ns: int) -> None:
        """Tell of a good measurement made at ``stamp_ns``."""
        last = self._last_good_ns
        if self._good_since_ns is None or last is None or stamp_ns - last > self._limits.timeout_s * NS:
            self._good_since_ns = stamp_ns
        self._last_good_ns = stamp_ns
        self._complaint = ""
        self._good_ns.append(stamp_ns)
        while self._good_ns[0] < stamp_ns - RATE_OVER_S * NS:
            self._good_ns.popleft()

    def bad(self, reason: str) -> None:
        """Tell of a measurement that can't be used, and why."""
        self._complaint = reason
        self._good_since_ns = None

    def tick(self, now_ns: int) -> Verdict:
        """Return the verdict at this moment; call at 20 Hz or faster. A clock that jumps back by a second starts the watch anew."""
        if self._last_tick_ns is not None and now_ns < self._last_tick_ns - NS:
            self._restart()
        # After a late tick, what arrived meanwhile may still wait in the socket: judge at the next one.
        late = self._last_tick_ns is not None and now_ns - self._last_tick_ns > LATE_TICK_S * NS
        self._last_tick_ns = now_ns
        self._started_ns = self._started_ns if self._started_ns is not None else now_ns
        overdue = self._overdue(now_ns)
        if overdue and self.verdict is not Verdict.BROKEN and not late:
            self.verdict = Verdict.BROKEN
        elif not overdue and self._is_good():
            self.verdict = Verdict.OK
        self.reason = self._explain(now_ns)
        return self.verdict

    def age_s(self, now_ns: int) -> float:
        """Return the age of the last good measurement; infinite before the first."""
        return float("inf") if self._last_good_ns is None else (now_ns - self._last_good_ns) / NS

    def rate_hz(self, now_ns: int) -> float:
        """Return how many good measurements came a second over the last two."""
        recent = [stamp for stamp in self._good_ns if stamp > now_ns - RATE_OVER_S * NS]
        return (len(recent) - 1) * NS / (recent[-1] - recent[0]) if len(recent) > 1 else 0.0

    def _overdue(self, now_ns: int) -> bool:
        if self._last_good_ns is not None:
            return now_ns - self._last_good_ns > self._limits.timeout_s * NS
        return self._started_ns is not None and now_ns - self._started_ns > self._limits.start_s * NS

    def _is_good(self) -> bool:
        if self._last_good_ns is None:
            return False
        if self.verdict is not Verdict.BROKEN:
            return True
        since = self._good_since_ns
        return since is not None and self._last_good_ns - since >= self._limits.recover_s * NS

    def _explain(self, now_ns: int) -> str:
        if self.verdict is Verdict.OK:
            return ""
        if self._complaint:
            return self._complaint
        if self._last_good_ns is None:
            return "nothing received yet"
        if self._overdue(now_ns):
            return f"no good measurement for {self._limits.timeout_s:g} s"
        return "recovering"
