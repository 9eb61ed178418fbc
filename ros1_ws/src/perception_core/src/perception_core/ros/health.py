"""Watch a sensor on the mission clock, publish ``~health`` and report the resource's state to the skillset."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

import rospy
from uav_msgs.msg import SensorHealth

from perception_core.health import FaultKind, Finding, HealthLimits, HealthWatch, Verdict, broken
from perception_core.poses import NS
from perception_core.stamps import StampJudge, StampLimits
from resource_reporter import ResourceReporter

if TYPE_CHECKING:
    from collections.abc import Callable

TICK_S = 0.02
PUBLISH_S = 0.1
VERDICTS = {Verdict.UNKNOWN: SensorHealth.UNKNOWN, Verdict.OK: SensorHealth.OK, Verdict.BROKEN: SensorHealth.BROKEN}


class HealthReporter:
    """A health watch driven by a 50 Hz timer on the ROS clock; its methods may be called from any thread."""

    def __init__(self, sensor: str, *, resource: str, limits: HealthLimits, stamps: StampLimits) -> None:
        self.missing: Callable[[], str] = lambda: ""
        """Says which inputs have no driver; to be set by the subscriber."""
        self._sensor = sensor
        self._resource = resource
        self._watch = HealthWatch(limits)
        self._stamps = StampJudge(stamps)
        self._lock = Lock()
        self._told = Verdict.UNKNOWN
        self._judged = False
        self._reported: tuple[Verdict, str] | None = None
        self._published_ns = 0
        self._reporter = ResourceReporter("perception")
        self._publisher = rospy.Publisher("~health", SensorHealth, queue_size=1)
        # reset: a clock that jumps back (a bag played again) must not end the timer's thread.
        self._timer = rospy.Timer(rospy.Duration.from_sec(TICK_S), self._tick, reset=True)

    def stamp(self, stamp_ns: int) -> Finding:
        """Return what the stamp of a measurement tells that has just arrived; call it once for each, in order."""
        with self._lock:
            return self._stamps.finding(stamp_ns, rospy.Time.now().to_nsec())

    def take(self, finding: Finding) -> None:
        """Tell what was found of a measurement that has just arrived."""
        with self._lock:
            self._watch.take(finding, rospy.Time.now().to_nsec())

    def tune(self, limits: HealthLimits, stamps: StampLimits) -> None:
        """Go on with other limits."""
        with self._lock:
            self._watch.limits = limits
            self._stamps.limits = stamps

    def garbage(self, reason: str) -> None:
        """Tell of something that is no measurement at all."""
        self.take(broken(FaultKind.FORMAT, reason))

    @property
    def ok(self) -> bool:
        """Whether the sensor is to be believed now."""
        with self._lock:
            return self._watch.verdict is Verdict.OK

    @property
    def reason(self) -> str:
        """Why it is not to be believed."""
        with self._lock:
            return self._watch.reason

    def _tick(self, _event: object) -> None:
        now_ns, missing = rospy.Time.now().to_nsec(), self.missing()
        with self._lock:
            verdict = self._watch.tick(now_ns, missing=missing)
            message = self._message(now_ns)
        changed = verdict is not self._told
        self._told = verdict
        if changed:
            rospy.loginfo(f"{self._sensor} is {verdict.value} {message.reason}")
        self._judged |= changed
        self._report(verdict, message)
        # Half a tick of tolerance, or the clock's grain would turn 10 Hz into 8.
        if changed or not 0 <= now_ns - self._published_ns < (PUBLISH_S - TICK_S / 2) * NS:
            self._published_ns = now_ns
            self._publisher.publish(message)

    def _report(self, verdict: Verdict, message: SensorHealth) -> None:
        """Tell the skillset a new verdict or a new kind of fault, with its reason; the figures in a reason change all the time.

        Before its first verdict a node that was started again knows nothing against what the one before it has said.
        """
        news = (verdict, message.fault if self._judged else message.reason)
        if news != self._reported:
            self._reported = news
            self._reporter.report(self._resource, verdict.value, message.reason, insist=self._judged)

    def _message(self, now_ns: int) -> SensorHealth:
        watch = self._watch
        message = SensorHealth(sensor=self._sensor, ok=watch.verdict is Verdict.OK, reason=watch.reason)
        message.verdict, message.fault = VERDICTS[watch.verdict], watch.fault.value
        message.header.stamp = rospy.Time(now_ns // NS, now_ns % NS)
        message.rate_hz = watch.rate_hz(now_ns)
        message.age_s = watch.age_s(now_ns)
        return message
