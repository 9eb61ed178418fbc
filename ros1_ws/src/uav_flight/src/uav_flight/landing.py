"""Lands the vehicle through the guidance when no mission decides any more."""

from __future__ import annotations

import logging
import threading
from typing import Any

import rospy
from std_msgs.msg import Header
from uav_msgs.msg import GuidanceState
from uav_msgs.srv import Command

from alula.runtime.live.part import Clock

LANDING_TIMEOUT_S = 90.0  # mission clock; a landing from 20 m takes about 40 s
STATE_TIMEOUT_S = 30.0  # wall clock until the guidance, perhaps just started again, says how things are
AGAIN_S = 1.0  # wall clock, between two requests
FOR_EVER_S = 2**31

log = logging.getLogger("alula.landing")


class Landing:
    """Lands the vehicle where it is ours. Nothing is done where it is down already, or where the pilot or a failsafe has it."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._heard, self._down = threading.Event(), threading.Event()
        self._commanded, self._reference = False, ""
        self.refused = ""
        """Why the last request to land was refused or not heard, in words; empty: it was accepted."""
        self._heartbeat: Any = None
        if self._clock.simulated:
            self._end_heartbeats()
        self._subscriber = rospy.Subscriber("/uav_guidance/state", GuidanceState, self._look, queue_size=1)

    def land(self) -> None:
        """Return when the vehicle is down, when somebody else has it, or when it takes too long."""
        if not self._heard.wait(STATE_TIMEOUT_S):
            return
        end_s = (self._clock.now_s or 0.0) + LANDING_TIMEOUT_S
        # Again where something else is followed instead: a skill that was running may have answered the first with a hover.
        while self._commanded and not self._down.is_set() and (self._clock.now_s or 0.0) < end_s and not self._clock.stands_still:
            if self._reference != "land":
                self._command()
            self._down.wait(AGAIN_S)

    def _look(self, state: Any) -> None:
        self._commanded, self._reference = state.authority, state.reference
        if not state.armed:
            self._down.set()
        self._heard.set()

    def _command(self) -> None:
        try:
            rospy.wait_for_service("/uav_guidance/land", timeout=10.0)
            answer = rospy.ServiceProxy("/uav_guidance/land", Command)()
            self.refused = "" if answer.accepted else f"the guidance refuses to: {answer.reason}"
        except (rospy.ROSException, rospy.ServiceException) as error:
            self.refused = f"the guidance could not be told to: {error}"
        if self.refused:
            log.warning("landing: %s", self.refused)
        else:
            log.info("landing: accepted")

    def _end_heartbeats(self) -> None:
        """Have simulated time wait no more for a mission that has ended: its heartbeats came over the bridge, which goes on."""
        self._heartbeat = rospy.Publisher("/mission/heartbeat", Header, queue_size=1, latch=True)
        self._heartbeat.publish(Header(stamp=rospy.Time(FOR_EVER_S), frame_id="supervisor"))
