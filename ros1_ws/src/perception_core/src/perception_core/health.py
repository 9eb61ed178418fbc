"""Is a sensor healthy? A watch that gets every measurement and returns its verdict; no ROS, times in nanoseconds."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

from perception_core.poses import NS

RATE_OVER_S = 2.0
INTERVALS = 5  # between the last measurements, good or bad: the shortest tells how often they come
TIMEOUT_INTERVALS = 2.5  # of this interval: one measurement of a slow sensor may be lost, as one of a fast one may
LONGEST_TIMEOUT_S = 0.75
LATE_TICK_S = 0.1


class Verdict(Enum):
    """The health of the sensor; the values are the states of the skillset's resource."""

    UNKNOWN = "UNKNOWN"
    OK = "OK"
    BROKEN = "BROKEN"


class FaultKind(Enum):
    """The kind of a sensor's fault; the values are those of ``SensorHealth.fault``."""

    NONE = ""
    SILENT = "silent"  # nothing comes
    STAMP = "stamp"  # of the future, too old, or not advancing
    FORMAT = "format"  # can't be decoded: encoding, fields, sizes, cut short
    EXPOSURE = "exposure"  # dark, blank, overexposed
    BLUR = "blur"
    FROZEN = "frozen"
    VIEW = "view"  # both cameras don't see the same scene, or see too little of it
    CALIBRATION = "calibration"  # the cameras see the same scene, but not as a rectified pair does
    INFO = "info"  # camera_info contradicts itself or the images
    RETURNS = "returns"
    SECTOR = "sector"
    RANGE = "range"


@dataclass(frozen=True)
class Finding:
    """What one measurement shows of its sensor: OK, BROKEN or can't be judged (UNKNOWN), with a sentence where it is not OK."""

    verdict: Verdict = Verdict.OK
    fault: FaultKind = FaultKind.NONE
    reason: str = ""

    @property
    def ok(self) -> bool:
        """Whether the measurement can be used."""
        return self.verdict is Verdict.OK


FINE = Finding()


def broken(fault: FaultKind, measured: str, *causes: str) -> Finding:
    """Return the finding of a broken sensor: what was measured, and its likeliest causes, two at most, the likelier one first."""
    return Finding(Verdict.BROKEN, fault, sentence(measured, *causes))


def unsure(fault: FaultKind, measured: str, *causes: str) -> Finding:
    """Return the finding of a sensor that can't be judged by this measurement, in words as those of ``broken``."""
    return Finding(Verdict.UNKNOWN, fault, sentence(measured, *causes))


def sentence(measured: str, *causes: str) -> str:
    """Return a finding in words: what was measured, then what may be the cause."""
    return f"{measured}: {', or '.join(causes)}" if causes else measured


def first_trouble(*findings: Finding) -> Finding:
    """Return the first finding of a broken sensor, else the first that can't be judged, else that all is fine."""
    for verdict in (Verdict.BROKEN, Verdict.UNKNOWN):
        for finding in findings:
            if finding.verdict is verdict:
                return finding
    return FINE


@dataclass(frozen=True)
class HealthLimits:
    """Seconds of mission clock: without a good measurement until broken, of good ones until mended, of nothing at first until broken."""

    timeout_s: float = 0.35
    recover_s: float = 1.0
    start_s: float = 5.0


class HealthWatch:
    """Judge a stream of measurements by when the last good one arrived.

    A bad measurement (black, frozen, empty) never breaks the sensor by itself: it does not count as good, so that one glitch passes and a
    lasting fault shows within ``timeout_s`` of the last good measurement, of a slow sensor within 2.5 of its intervals. When that time is
    over, the verdict is that of what came meanwhile: UNKNOWN if it only could not be judged, else BROKEN. Not thread-safe: the caller
    serialises.
    """

    def __init__(self, limits: HealthLimits) -> None:
        self.limits = limits
        self._restart()

    def _restart(self) -> None:
        self.verdict = Verdict.UNKNOWN
        self.fault = FaultKind.SILENT
        self.reason = "nothing received yet"
        self._missing = ""
        self._judged = False  # whether there was another verdict than UNKNOWN
        self._started_ns: int | None = None
        self._last_tick_ns: int | None = None
        self._last_good_ns: int | None = None
        self._good_since_ns: int | None = None
        self._trouble: Finding | None = None
        self._trouble_ns = 0
        self._good_ns: deque[int] = deque()
        self._arrived_ns: deque[int] = deque(maxlen=INTERVALS + 1)

    def take(self, finding: Finding, arrived_ns: int) -> None:
        """Store the finding about a measurement that arrived at ``arrived_ns``, nanoseconds."""
        self._arrived_ns.append(arrived_ns)
        if finding.ok:
            self._good(arrived_ns)
        else:
            self._trouble, self._trouble_ns = finding, arrived_ns
            self._good_since_ns = None

    def _good(self, arrived_ns: int) -> None:
        last = self._last_good_ns
        if self._good_since_ns is None or last is None or arrived_ns - last > self._timeout_ns():
            self._good_since_ns = arrived_ns
        self._last_good_ns = arrived_ns
        self._trouble = None
        self._good_ns.append(arrived_ns)
        while self._good_ns[0] < arrived_ns - RATE_OVER_S * NS:
            self._good_ns.popleft()

    def tick(self, now_ns: int, *, missing: str = "") -> Verdict:
        """Return the verdict at this moment; call at 20 Hz or faster. A clock that jumps back by a second starts the watch again.

        ``missing`` names what has no driver: as long as nothing was received either, the sensor is not there yet, which is not broken.
        """
        if self._last_tick_ns is not None and now_ns < self._last_tick_ns - NS:
            self._restart()
        # After a late tick, what arrived meanwhile may still wait in the socket: judge at the next one.
        late = self._last_tick_ns is not None and now_ns - self._last_tick_ns > LATE_TICK_S * NS
        self._last_tick_ns = now_ns
        self._missing = missing if self._last_good_ns is None and self._trouble is None else ""
        self._started_ns = now_ns if self._started_ns is None or self._missing else self._started_ns
        if self._overdue(now_ns):
            if not late:
                self.verdict = self._verdict_without_good(now_ns)
        elif self._is_good():
            self.verdict = Verdict.OK
        self._judged |= self.verdict is not Verdict.UNKNOWN
        self.fault, self.reason = self._explain(now_ns)
        return self.verdict

    def age_s(self, now_ns: int) -> float:
        """Return the time since the arrival of the last good measurement; infinite before the first."""
        return float("inf") if self._last_good_ns is None else (now_ns - self._last_good_ns) / NS

    def rate_hz(self, now_ns: int) -> float:
        """Return how many good measurements came a second over the last two seconds; a simulated clock may give two the same arrival."""
        recent = [stamp for stamp in self._good_ns if stamp > now_ns - RATE_OVER_S * NS]
        span_ns = recent[-1] - recent[0] if recent else 0
        return (len(recent) - 1) * NS / span_ns if span_ns > 0 else 0.0

    def _timeout_ns(self) -> float:
        """Return how long the sensor may be without a good measurement."""
        known = len(self._arrived_ns) > INTERVALS
        usual_ns = min(later - earlier for earlier, later in pairwise(self._arrived_ns)) if known else 0
        return max(self.limits.timeout_s * NS, min(TIMEOUT_INTERVALS * usual_ns, LONGEST_TIMEOUT_S * NS))

    def _verdict_without_good(self, now_ns: int) -> Verdict:
        trouble = self._fresh_trouble(now_ns)
        return Verdict.BROKEN if trouble is None else trouble.verdict

    def _fresh_trouble(self, now_ns: int) -> Finding | None:
        """Return what the last measurement complained about; None when none came within the time-out: then the sensor is silent."""
        fresh = self._trouble is not None and now_ns - self._trouble_ns <= self._timeout_ns()
        return self._trouble if fresh else None

    def _overdue(self, now_ns: int) -> bool:
        if self._last_good_ns is not None:
            return now_ns - self._last_good_ns > self._timeout_ns()
        return self._started_ns is not None and now_ns - self._started_ns > self.limits.start_s * NS

    def _is_good(self) -> bool:
        if self._last_good_ns is None:
            return False
        if self.verdict is Verdict.OK or (self.verdict is Verdict.UNKNOWN and not self._judged):
            return True
        since = self._good_since_ns
        return since is not None and self._last_good_ns - since >= self.limits.recover_s * NS

    def _explain(self, now_ns: int) -> tuple[FaultKind, str]:
        if self.verdict is Verdict.OK:
            return FaultKind.NONE, ""
        trouble = self._fresh_trouble(now_ns)
        if trouble is not None:
            return trouble.fault, trouble.reason
        if self._last_good_ns is None:
            return FaultKind.SILENT, self._missing or "nothing received yet"
        if self._overdue(now_ns):
            silent = f"no measurement for {self._timeout_ns() / NS:.2g} s"
            return FaultKind.SILENT, sentence(silent, "the driver has stopped", "its connection is lost")
        return self.fault, "recovering"
