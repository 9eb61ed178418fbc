"""Watch a sensor on the mission clock, publish ``~health`` and report the resource's state to the skillset."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

from genpy import Time
from uav_msgs.msg import SensorHealth

from node_core.core import Output
from perception_core.health import FaultKind, Finding, HealthLimits, HealthWatch, Verdict, broken
from perception_core.poses import NS
from perception_core.stamps import StampJudge, StampLimits

if TYPE_CHECKING:
    from node_core.core import Host

TICK_S = 0.02
PUBLISH_S = 0.1
HEALTH = Output("~health", SensorHealth)
VERDICTS = {Verdict.UNKNOWN: SensorHealth.UNKNOWN, Verdict.OK: SensorHealth.OK, Verdict.BROKEN: SensorHealth.BROKEN}


class SensorWatch:
    """A health watch of one sensor; ``tick`` is to be called every `TICK_S`. Its methods may be called from any thread."""

    def __init__(self, host: Host, sensor: str, *, resource: str, limits: HealthLimits, stamps: StampLimits) -> None:
        self._host = host
        self._sensor = sensor
        self._resource = resource
        self._watch = HealthWatch(limits)
        self._stamps = StampJudge(stamps)
        self._lock = Lock()
        self._told = Verdict.UNKNOWN
        self._judged = False
        self._reported: tuple[Verdict, str] | None = None
        self._published_ns = 0

    def stamp(self, stamp_ns: int) -> Finding:
        """Return the finding about the stamp of a measurement that has just arrived; call it once for each, in order."""
        with self._lock:
            return self._stamps.finding(stamp_ns, self._host.now_ns())

    def take(self, finding: Finding) -> None:
        """Store the finding about a measurement that has just arrived."""
        with self._lock:
            self._watch.take(finding, self._host.now_ns())

    def tune(self, limits: HealthLimits, stamps: StampLimits) -> None:
        """Set other limits."""
        with self._lock:
            self._watch.limits = limits
            self._stamps.limits = stamps

    def garbage(self, reason: str) -> None:
        """Report a message that is no measurement."""
        self.take(broken(FaultKind.FORMAT, reason))

    @property
    def ok(self) -> bool:
        """Whether the sensor is healthy now."""
        with self._lock:
            return self._watch.verdict is Verdict.OK

    @property
    def reason(self) -> str:
        """Why it is not healthy; empty where it is."""
        with self._lock:
            return self._watch.reason

    def tick(self, missing: str) -> None:
        """Judge at this moment; ``missing`` names the inputs without a driver."""
        now_ns = self._host.now_ns()
        with self._lock:
            verdict, fault, reason = self._watch.tick(now_ns, missing=missing), self._watch.fault, self._watch.reason
            changed = verdict is not self._told
            # Half a tick of tolerance, or the clock's grain would turn 10 Hz into 8.
            due = changed or not 0 <= now_ns - self._published_ns < (PUBLISH_S - TICK_S / 2) * NS
            message = self._message(now_ns) if due else None
        self._told = verdict
        if changed:
            self._host.info(f"{self._sensor} is {verdict.value} {reason}")
        self._judged |= changed
        self._report(verdict, fault, reason)
        if message is not None:
            self._published_ns = now_ns
            self._host.publish(HEALTH.topic, message)

    def _report(self, verdict: Verdict, fault: FaultKind, reason: str) -> None:
        """Tell the skillset a new verdict or a new kind of fault, with its reason; the figures in a reason change all the time.

        Before its first verdict a node that was started again knows nothing against what the one before it has said.
        """
        news = (verdict, fault.value if self._judged else reason)
        if news != self._reported:
            self._reported = news
            self._host.report(self._resource, verdict.value, reason, insist=self._judged)

    def _message(self, now_ns: int) -> SensorHealth:
        watch = self._watch
        message = SensorHealth(sensor=self._sensor, ok=watch.verdict is Verdict.OK, reason=watch.reason)
        message.verdict, message.fault = VERDICTS[watch.verdict], watch.fault.value
        message.header.stamp = Time(now_ns // NS, now_ns % NS)
        message.rate_hz = watch.rate_hz(now_ns)
        message.age_s = watch.age_s(now_ns)
        return message
