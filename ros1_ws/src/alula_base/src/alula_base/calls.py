"""The calls that stop the robot, a class for each kind, each with a time limit. ``run`` returns the outcome, or raises CallFailedError."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import time
from typing import Any, Callable, Protocol

import genpy
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from geometry_msgs.msg import Twist
from roslib.message import get_service_class

from alula_base.errors import ConfigError
from alula_base.settings import CallSettings, CancelSettings, ScriptSettings, ServiceSettings, ZeroSettings
from resource_reporter import CallFailedError, ServiceCaller

AGAIN_S = 0.1
"""What was not answered, and a cancellation, is sent again so often."""
OPEN = (GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING)

Silent = Callable[[], bool]
"""Tells whether a heartbeat is silent still: what has been done once is repeated only so long."""


class StopCall(Protocol):
    """A call to make when a heartbeat is silent."""

    def run(self, silent: Silent) -> str:
        """Execute the call, in a thread of its own, and return the outcome in words; raises CallFailedError."""
        ...


class ServiceCall:
    """Calls a service until it answers."""

    def __init__(self, name: str, settings: ServiceSettings) -> None:
        kind = get_service_class(settings.type)
        if kind is None:
            raise ConfigError(f"~stop/{name}/type: there is no service type {settings.type} here; build its package in this workspace")
        self._request = kind._request_class()  # noqa: SLF001 -- so rospy's own tools find it
        try:
            genpy.message.fill_message_args(self._request, [dict(settings.request)])
            self._request._check_types()  # noqa: SLF001
        except (genpy.MessageException, genpy.SerializationError, ValueError, TypeError) as error:
            raise ConfigError(f"~stop/{name}/request does not fit {settings.type}: {error}") from error
        self._caller = ServiceCaller(rospy.resolve_name(settings.service), kind)
        self._within_s = settings.within_s

    def run(self, silent: Silent) -> str:
        """Call; an answer whose ``success`` or ``accepted`` is false counts as none."""
        end_s = time.monotonic() + self._within_s
        while True:
            try:
                answer = self._caller.call(self._request, limit_s=max(AGAIN_S, end_s - time.monotonic()))
            except CallFailedError as error:
                problem = str(error)
            else:
                if getattr(answer, "success", True) and getattr(answer, "accepted", True):
                    return f"{self._caller.name} has answered"
                why = getattr(answer, "message", "") or getattr(answer, "reason", "")
                problem = f"{self._caller.name} has refused: {why}"
            if time.monotonic() + AGAIN_S > end_s or not silent():
                raise CallFailedError(problem)
            time.sleep(AGAIN_S)


class ZeroVelocity:
    """Publishes zero velocity."""

    def __init__(self, _name: str, settings: ZeroSettings) -> None:
        self._publisher = rospy.Publisher(settings.zero, Twist, queue_size=1, tcp_nodelay=True)
        self._period_s, self._for_s = 1.0 / settings.rate_hz, settings.for_s

    def run(self, silent: Silent) -> str:
        """Publish until the time is over, or the heartbeat is back."""
        end_s = time.monotonic() + self._for_s
        heard, sent = False, 0
        while True:
            self._publisher.publish(Twist())
            sent += 1
            heard = heard or self._publisher.get_num_connections() > 0
            if time.monotonic() + self._period_s > end_s or not silent():
                break
            time.sleep(self._period_s)
        if not heard:
            raise CallFailedError(f"nobody listens on {self._publisher.resolved_name}")
        return f"sent {sent} times on {self._publisher.resolved_name}"


class CancelGoals:
    """Cancels all goals of an action."""

    def __init__(self, _name: str, settings: CancelSettings) -> None:
        self._action = rospy.resolve_name(settings.cancel)
        self._within_s = settings.within_s
        self._heard_s = 0.0
        self._open = 0
        self._publisher = rospy.Publisher(f"{self._action}/cancel", GoalID, queue_size=5, tcp_nodelay=True)
        self._subscriber = rospy.Subscriber(f"{self._action}/status", GoalStatusArray, self._hear, queue_size=1)

    def _hear(self, message: GoalStatusArray) -> None:
        self._open = sum(one.status in OPEN for one in message.status_list)
        self._heard_s = time.monotonic()

    def run(self, silent: Silent) -> str:
        """Cancel until the server reports that no goal is open."""
        begin_s = time.monotonic()
        end_s = begin_s + self._within_s
        while True:
            self._publisher.publish(GoalID())  # without id and stamp: all goals
            time.sleep(AGAIN_S)
            if self._heard_s > begin_s and not self._open:
                return f"{self._action} has no goal any more"
            if time.monotonic() > end_s or not silent():
                break
        if self._heard_s <= begin_s:
            raise CallFailedError(f"{self._action}/status says nothing")
        raise CallFailedError(f"{self._action} has {self._open} goals still")


class Script:
    """Runs a program."""

    def __init__(self, name: str, settings: ScriptSettings) -> None:
        if shutil.which(settings.script[0]) is None:
            raise ConfigError(f"~stop/{name}/script: there is no program {settings.script[0]}")
        self._words, self._within_s = settings.script, settings.within_s

    def run(self, silent: Silent) -> str:  # noqa: ARG002 -- it is done once
        """Run it to its end."""
        try:
            process = subprocess.Popen(self._words, stdin=subprocess.DEVNULL, start_new_session=True)
        except OSError as error:
            raise CallFailedError(f"{self._words[0]} can't be started: {error}") from error
        try:
            code = process.wait(self._within_s)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise CallFailedError(f"{self._words[0]} was killed after {self._within_s:g} s") from None
        if code:
            raise CallFailedError(f"{self._words[0]} has ended with {code}")
        return f"{self._words[0]} has ended"


MAKERS: dict[type, Callable[[str, Any], StopCall]] = {
    ServiceSettings: ServiceCall,
    ZeroSettings: ZeroVelocity,
    CancelSettings: CancelGoals,
    ScriptSettings: Script,
}


def make_call(name: str, settings: CallSettings) -> StopCall:
    """Make a call from its settings, with its connections open before they are needed; raises ConfigError."""
    return MAKERS[type(settings)](name, settings)
