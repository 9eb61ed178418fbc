"""The ROS node /uav_guidance: services, obstacles and the map's correction in, state and pose out, the autopilot behind a MAVLink link."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from functools import partial
from typing import Any

import rospy
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState, MappingState, Obstacle
from uav_msgs.srv import (
    CheckFence,
    CheckFenceRequest,
    CheckFenceResponse,
    Command,
    CommandResponse,
    SetHeadingReference,
    SetHeadingReferenceRequest,
    SetHeadingReferenceResponse,
    SetPositionReference,
    SetPositionReferenceRequest,
    SetPositionReferenceResponse,
    Takeoff,
    TakeoffResponse,
)
from uav_msgs.srv import TakeoffRequest as TakeoffCall

from node_core.core import Input
from node_core.ros import RawSubscriber, warn_of_garbage
from perception_core.conversions import MAP
from perception_core.ros import TunableSettings, read_settings
from resource_reporter import DoneReporter, ResourceReporter, ToldService, send_directly
from uav_guidance import requests
from uav_guidance.encoding import command_message, heartbeat_message, interval_message, setpoint_message
from uav_guidance.follower import Setpoint
from uav_guidance.guidance import Guidance
from uav_guidance.link import Link
from uav_guidance.messages import (
    correction_message,
    map_to_odom,
    pose_message,
    sighting,
    state_message,
    time_of,
    transform_message,
    vec3,
)
from uav_guidance.settings import GuidanceSettings
from uav_guidance.stamping import Alarm, FineClock, StampClock, Steps
from uav_guidance.streams import STREAMS_HZ, StreamKeeper
from uav_guidance.takeover import CHECKS, LEAST_SEVERITY
from uav_guidance.texts import TextAssembler

log = logging.getLogger(__name__)

HEARTBEAT_PERIOD_S = 1.0
LOOK_S = 0.3  # wall clock; how often a sleep looks whether the node is shut down
BUFFER_BYTES = 1 << 16
TRANSFORMS_WAITING = 50  # our own, at 50 Hz, come back on the same topic
# The autopilot's agreement is bounded on the mission clock; this bounds the wait of a caller should that clock stand still.
AGREEMENT_WALL_S = 30.0
SKILLSET = "navigation"


class GuidanceNode:
    """Connect the pure guidance with ROS and with the link; one lock guards it against the threads of both."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self._guidance = Guidance(settings)
        self._changed = threading.Condition(threading.RLock())
        self._streams = StreamKeeper()
        self._stamps = StampClock()
        self._fine_clock = FineClock()
        self._alarm = Alarm()
        self._simulated = bool(rospy.get_param("/use_sim_time", False))
        if self._simulated:
            rospy.Subscriber("/clock", Clock, self._on_clock, queue_size=10, tcp_nodelay=True)
        self._texts = TextAssembler()
        self._heartbeat_s = -HEARTBEAT_PERIOD_S
        self._reporter = ResourceReporter(SKILLSET)
        self._state = rospy.Publisher("~state", GuidanceState, queue_size=5)
        self._told = rospy.Publisher("~told", String, queue_size=10)
        self._pose = rospy.Publisher("~pose", PoseStamped, queue_size=10)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._taken = rospy.Publisher("~taken", Header, queue_size=10, tcp_nodelay=True)
        self._stepped_ns = self._done_ns = 0
        self._link = Link(
            settings.url,
            settings.baud,
            on_message=self._on_message,
            on_connect=self._on_connect,
            on_idle=self._report_done,
        )
        for topic in ("/zed_depth/obstacle", "/lidar_obstacles/obstacle"):
            RawSubscriber(Input(topic, Obstacle, partial(self._on_obstacle, topic), _on_garbage, BUFFER_BYTES, queue_size=5))
        RawSubscriber(Input("/lidar_mapping/state", MappingState, self._on_mapping, warn_of_garbage, BUFFER_BYTES))
        transforms = Input("/tf", TFMessage, self._on_transforms, warn_of_garbage, BUFFER_BYTES, TRANSFORMS_WAITING, about=MAP.encode())
        RawSubscriber(transforms)
        self._offer_services()
        self._tuning = TunableSettings(settings, self._tune)
        self._done = DoneReporter(self._reporter)

    def run(self) -> None:
        """Step at 20 Hz of the mission clock until the node is shut down; a clock that starts late is waited for."""
        self._link.start()
        steps = Steps(rospy.get_rostime().to_nsec())
        while not rospy.is_shutdown():
            self._step()
            now_ns = rospy.get_rostime().to_nsec()
            if steps.made(now_ns):
                self._stepped_ns = now_ns
                if self._link.idle:
                    self._report_done()
            self._sleep_until(steps.due_ns)
        self._link.close()
        self._reporter.close()

    def _sleep_until(self, due_ns: int) -> None:
        """Sleep until a moment of the mission clock, or until it is set back, or the node is shut down."""
        now_ns = rospy.get_rostime().to_nsec()
        if not self._simulated or now_ns == 0:  # rospy waits for a clock that was not heard yet
            with contextlib.suppress(rospy.ROSInterruptException):
                rospy.sleep((due_ns - now_ns) / 1e9)
            return
        while not (rospy.is_shutdown() or self._alarm.wait(due_ns, LOOK_S)):
            pass

    # ---- services ------------------------------------------------------------------------------------------------------

    def _offer_services(self) -> None:
        ToldService("~takeoff", Takeoff, self._take_off)
        ToldService("~set_position", SetPositionReference, self._set_position)
        ToldService("~set_heading", SetHeadingReference, self._set_heading)
        ToldService("~hover", Command, lambda _: self._ask(requests.HoverRequest(), CommandResponse))
        ToldService("~stop", Command, lambda _: self._ask(requests.StopRequest(), CommandResponse))
        ToldService("~land", Command, lambda _: self._ask(requests.LandRequest(), CommandResponse))
        ToldService("~take_authority", Command, lambda _: self._ask(requests.AuthorityRequest(), CommandResponse))
        ToldService("~check_fence", CheckFence, self._check_fence)

    def _take_off(self, call: TakeoffCall) -> TakeoffResponse:
        return self._ask(requests.TakeoffRequest(call.height_m, call.speed_m_s), TakeoffResponse)

    def _set_position(self, call: SetPositionReferenceRequest) -> SetPositionReferenceResponse:
        along_travel = call.heading == SetPositionReferenceRequest.ALONG_TRAVEL
        request = requests.PositionRequest(vec3(call.target_enu_m), call.speed_m_s, along_travel)
        return self._ask(request, SetPositionReferenceResponse)

    def _set_heading(self, call: SetHeadingReferenceRequest) -> SetHeadingReferenceResponse:
        request = requests.HeadingRequest(call.yaw_rad, call.rate_rad_s, lock=call.lock, release=call.release)
        return self._ask(request, SetHeadingReferenceResponse)

    def _check_fence(self, call: CheckFenceRequest) -> CheckFenceResponse:
        with self._changed:
            reason = self._guidance.fence_reason(vec3(call.target_enu_m))
        return CheckFenceResponse(inside=not reason, reason=reason)

    def _ask(self, request: requests.Request, response: Any) -> Any:
        """Ask the guidance, act at once, and answer when the autopilot has agreed or refused (its words are the reason)."""
        with self._changed:
            decision = self._guidance.ask(request, _now_s())
            self._advance()
            procedure = decision.procedure
            accepted, reason = decision.accepted, decision.reason
            if procedure is not None:
                self._changed.wait_for(lambda: procedure.outcome is not None or rospy.is_shutdown(), AGREEMENT_WALL_S)
                outcome = procedure.outcome
                accepted = outcome is not None and outcome.accepted
                reason = outcome.reason if outcome is not None else "the autopilot has not answered"
        log.info("%s: %s", request, "accepted" if accepted else f"refused: {reason}")
        return response(accepted=accepted, reason=reason, reference_id=decision.reference_id if accepted else 0)

    def _tune(self, settings: GuidanceSettings) -> None:
        with self._changed:
            self._guidance.tune(settings)

    # ---- what comes in -------------------------------------------------------------------------------------------------

    def _on_obstacle(self, topic: str, message: Obstacle) -> None:
        with self._changed:
            self._guidance.on_obstacle(sighting(message, self._guidance.correction), _now_s())
        self._taken.publish(Header(stamp=message.header.stamp, frame_id=rospy.resolve_name(topic)))

    def _on_mapping(self, message: MappingState) -> None:
        with self._changed:
            self._guidance.on_mapping(running=message.running, problem=message.problem, scans=message.scans, now_s=_now_s())

    def _on_transforms(self, message: TFMessage) -> None:
        newest = map_to_odom(message)
        if newest is not None:
            with self._changed:
                self._guidance.on_transform(newest)

    def _on_clock(self, message: Clock) -> None:
        now_ns = message.clock.to_nsec()
        self._fine_clock.tick(now_ns, time.monotonic_ns())
        self._alarm.tick(now_ns)

    def _on_connect(self) -> None:
        with self._changed:
            self._streams.forget()

    def _on_message(self, message: Any) -> None:
        """Take a message of the autopilot, in the link's thread; what can't wait for the next step is done at once."""
        arrival = rospy.get_rostime()
        kind = message.get_type()
        pose: PoseStamped | None = None
        with self._changed:
            self._streams.hear(message.get_msgId(), arrival.to_sec())
            if kind == "STATUSTEXT":
                self._on_text(message)
            self._guidance.on_message(message, arrival.to_sec())
            if kind == "LOCAL_POSITION_NED":
                pose = self._stamped_pose(message.time_boot_ms, arrival)
            elif kind == "COMMAND_ACK":
                self._advance()
            elif kind != "ATTITUDE":
                self._report_resources()
        if pose is not None:
            self._pose.publish(pose)
            self._tf.publish(transform_message(pose))

    def _on_text(self, message: Any) -> None:
        text = self._texts.take(message.text, message.id, message.chunk_seq)
        if text is not None:
            log.info("autopilot: %s", text)
            if message.severity <= LEAST_SEVERITY and not text.startswith(CHECKS):
                self._told.publish(String(f"autopilot: {text}"))
            self._guidance.on_text(message.severity, text, _now_s())

    def _stamped_pose(self, boot_ms: int, arrival: rospy.Time) -> PoseStamped | None:
        fine_ns = self._fine_clock.now_ns(time.monotonic_ns())
        stamp_ns = self._stamps.stamp_ns(boot_ms, arrival.to_nsec() if fine_ns is None else fine_ns)
        return None if stamp_ns is None else pose_message(self._guidance.odometry, time_of(max(stamp_ns, 0)))

    # ---- what goes out -------------------------------------------------------------------------------------------------

    def _step(self) -> None:
        """Make one step of 50 ms: heartbeat, streams, setpoints, state."""
        now = rospy.get_rostime()
        now_s = now.to_sec()
        with self._changed:
            if abs(now_s - self._heartbeat_s) >= HEARTBEAT_PERIOD_S:
                self._heartbeat_s = now_s
                self._link.send(heartbeat_message())
            for number in self._streams.due(now_s):
                self._link.send(interval_message(number, STREAMS_HZ[number]))
            self._advance()
            state = state_message(self._guidance.report(now_s), now)
            correction = correction_message(self._guidance.correction, now)
        self._tf.publish(correction)
        self._state.publish(state)

    def _report_done(self) -> None:
        """Tell up to when all steps are made, once, where all that the autopilot had sent by then has been taken."""
        with self._changed:
            stepped_ns, told_ns = self._stepped_ns, self._done_ns
            self._done_ns = stepped_ns
        if stepped_ns > told_ns:
            self._done.done(stepped_ns)

    def _advance(self) -> None:
        """Step the guidance to now and send its output."""
        for item in self._guidance.step(_now_s()):
            self._link.send(setpoint_message(item) if isinstance(item, Setpoint) else command_message(item))
        for note in self._guidance.take_notes():
            self._told.publish(String(f"guidance: {note}"))
        self._report_resources()
        self._changed.notify_all()

    def _report_resources(self) -> None:
        reasons = self._guidance.reasons(_now_s())
        for resource, state in self._guidance.resources().items():
            self._reporter.report(resource, state, reasons.get(resource, ""))


def _on_garbage(reason: str) -> None:
    log.warning("a sensor's verdict is left out, as if the sensor were silent: %s", reason)


def _now_s() -> float:
    return float(rospy.get_rostime().to_sec())


def main() -> None:
    """Run the guidance node, with its private parameters, until ROS shuts down."""
    send_directly(not_heard=["/tf"])  # the transform from map to odom is heard there; 70 of 80 messages a second are its own
    rospy.init_node("uav_guidance")
    GuidanceNode(read_settings(GuidanceSettings())).run()
