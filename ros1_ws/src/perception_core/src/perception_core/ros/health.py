"""Watch a sensor on the mission clock, publish ``~health`` and report the resource's state to the skillset."""

from __future__ import annotations

from threading import Lock

import rospy
from uav_msgs.msg import SensorHealth

from perception_core.health import HealthLimits, HealthWatch, Verdict
from perception_core.poses import NS
from resource_reporter import ResourceReporter

TICK_S = 0.02
PUBLISH_S = 0.1


class HealthReporter:
    """A health watch driven by a 50 Hz timer on the ROS clock; its methods may be called from any thread."""

    def __init__(self, sensor: str, *, resource: str, limits: HealthLimits) -> None:
        self._sensor = sensor
        self._resource = resource
        self._watch = HealthWatch(limits)
        self._lock = Lock()
        self._told = Verdict.UNKNOWN
        self._published_ns = 0
        self._reporter = ResourceReporter("perception")
        self._publisher = rospy.Publisher("~health", SensorHealth, queue_size=1)
        # reset: a clock that jumps back (a bag played again) must not end the timer's thread.
        self._timer = rospy.Timer(rospy.Duration.from_sec(TICK_S), self._tick, reset=True)

    def good(self, stamp_ns: int) -> None:
        """Tell of a good measurement."""
        with self._lock:
            self._watch.good(stamp_ns)

    def bad(self, reason: str) -> None:
        """Tell of a measurement that can't be used, and why."""
        with self._lock:
            self._watch.bad(reason)

    def _tick(self, _event: object) -> None:
        now_ns = rospy.Time.now().to_nsec()
        with self._lock:
            verdict = self._watch.tick(now_ns)
            message = self._message(now_ns)
        changed = verdict is not self._told
        self._told = verdict
        if changed and verdict is not Verdict.UNKNOWN:
            rospy.loginfo(f"{self._sensor} is {verdict.value} {message.reason}")
            self._reporter.report(self._resource, verdict.value)
        # Half a tick of tolerance, or the clock's grain would turn 10 Hz into 8.
        if changed or not 0 <= now_ns - self._published_ns < (PUBLISH_S - TICK_S / 2) * NS:
            self._published_ns = now_ns
            self._publisher.publish(message)

    def _message(self, now_ns: int) -> SensorHealth:
        message = SensorHealth(sensor=self._sensor, ok=self._watch.verdict is Verdict.OK, reason=self._watch.reason)
        message.header.stamp = rospy.Time(now_ns // NS, now_ns % NS)
        message.rate_hz = self._watch.rate_hz(now_ns)
        message.age_s = self._watch.age_s(now_ns)
        return message
