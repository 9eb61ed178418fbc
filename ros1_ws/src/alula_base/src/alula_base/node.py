"""The node /alula_base: hears heartbeats, and calls what stops the robot when one is silent."""

from __future__ import annotations

import functools
import json
import sys
import threading
from collections.abc import Sequence
from dataclasses import asdict

import rospy
from std_msgs.msg import String

from alula_base.calls import make_call
from alula_base.clock import SIMULATED_LOOK_S, is_simulated, now_s
from alula_base.errors import ConfigError
from alula_base.heartbeats import HEARD, SILENT, Change, Heartbeats
from alula_base.settings import ReportSettings, Settings, read_settings
from alula_base.worker import Worker
from resource_reporter import ResourceReporter, ends_the_node

REFUSED = 2
LONGEST_WAIT_S = 0.5
"""So long may the end of ROS stay unseen."""
SETTLE_S = 0.05
SHORTEST_WAIT_S = 0.001


class Supervision:
    """Reports to a skillset whether the decision side is heard.

    A silence is reported before its end: what could not be reported while the skillset was out of reach is reported afterwards.
    """

    def __init__(self, settings: ReportSettings) -> None:
        self._settings = settings
        self._reporter = ResourceReporter(settings.skillset)
        self._told = ""

    def silent(self, reason: str) -> None:
        """Report the silence."""
        self._tell(self._settings.silent, reason)

    def heard(self) -> bool:
        """Report that all heartbeats are back, once the skillset has received the silence before; return whether that was done."""
        if self._told == self._settings.silent and not self._reporter.knows():
            return False
        self._tell(self._settings.heard)
        return True

    def _tell(self, state: str, reason: str = "") -> None:
        self._told = state
        self._reporter.report(self._settings.resource, state, reason)


class DeadMan:
    """Stops the robot when the decision side is silent, by the clock of `alula_base.clock`; starts nothing again when it is back."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._heartbeats = Heartbeats(settings.heartbeats, settings.silent_after_s)
        self._changed = threading.Condition()
        self._stops = 0
        self._stopped_s: float | None = None
        self._state = rospy.Publisher("~state", String, queue_size=5, latch=True)
        calls = {name: (make_call(name, one), one.after_s) for name, one in settings.stop.items()}
        self._workers = {name: Worker(name, call, after_s, self._is_silent, self._show) for name, (call, after_s) in calls.items()}
        self._supervision = Supervision(settings.report) if settings.report else None
        self._owes_heard = False
        self._show()
        self._subscribers = [
            rospy.Subscriber(topic, rospy.AnyMsg, functools.partial(self._hear, topic), queue_size=1, tcp_nodelay=True)
            for topic in settings.heartbeats
        ]

    def run(self) -> None:
        """Watch until ROS shuts down."""
        while not rospy.is_shutdown():
            with self._changed:
                self._take(self._heartbeats.look(now_s()))
                if self._owes_heard and self._supervision is not None and self._supervision.heard():
                    self._owes_heard = False
                wait_s = self._heartbeats.wait_s(now_s())
                longest_s = SETTLE_S if self._owes_heard else SIMULATED_LOOK_S if is_simulated() else LONGEST_WAIT_S
                self._changed.wait(longest_s if wait_s is None else min(max(wait_s, SHORTEST_WAIT_S), longest_s))

    @ends_the_node
    def _hear(self, topic: str, _message: object) -> None:
        with self._changed:
            self._take(self._heartbeats.hear(topic, now_s()))

    def _take(self, changes: Sequence[Change]) -> None:
        """Do what changes ask for, under the lock."""
        silent = [change for change in changes if change.state == SILENT]
        if silent:
            self._stop(silent)
        for change in changes:
            if change.state == HEARD:
                rospy.logwarn("%s is heard%s", change.topic, f" again, after {change.silence_s:.2f} s" if change.silence_s else "")
        if changes:
            self._owes_heard = self._supervision is not None and self._heartbeats.state == HEARD
            self._show()
            self._changed.notify()

    def _stop(self, silent: Sequence[Change]) -> None:
        self._stops += 1
        self._stopped_s = rospy.get_time()
        for worker in self._workers.values():
            worker.want()
        reason = ", ".join(f"nothing heard of {change.topic} for {change.silence_s:.2f} s" for change in silent)
        rospy.logerr("%s: calling %s", reason, ", ".join(f"{name}{worker.when}" for name, worker in self._workers.items()))
        if self._supervision is not None:
            self._supervision.silent(f"{reason}: the robot was stopped")

    def _is_silent(self) -> bool:
        return self._heartbeats.state == SILENT

    def _show(self) -> None:
        """Publish what is so, from any thread."""
        with self._changed:
            shown = {
                "state": self._heartbeats.state,
                "heartbeats": self._heartbeats.states(),
                "silent_after_s": self._settings.silent_after_s,
                "stops": self._stops,
                "stopped_s": self._stopped_s,
                "calls": {name: asdict(worker.outcome) for name, worker in self._workers.items()},
            }
            self._state.publish(String(data=json.dumps(shown)))


def main() -> None:
    """Run the node; a wrong parameter is logged, and ends it with exit code 2."""
    rospy.init_node("alula_base")
    try:
        dead_man = DeadMan(read_settings(rospy.get_param("~", {})))
    except ConfigError as error:
        rospy.logfatal("%s", error)
        sys.exit(REFUSED)
    dead_man.run()
