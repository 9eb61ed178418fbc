"""The neighbours of a perception node on a live ROS graph, on a clock that the test moves."""

from __future__ import annotations

import struct
import threading
import time
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Self

import rospy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TransformStamped, Vector3
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from skillset_interfaces.msg import ResourceState, ResourceStates
from skillset_interfaces.srv import Transition, TransitionResponse
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState, Obstacle, SensorHealth

from perception_core.conversions import cloud_message
from perception_core.poses import NS

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    import numpy as np
    from numpy.typing import NDArray
    from skillset_interfaces.srv import TransitionRequest

STEP_NS = 20_000_000
STEP_WALL_S = 0.01
SENSOR_STEPS = 5
HEALTH_NS = NS // 10
LONGEST_WORK_WALL_S = 5.0  # of a node on one measurement, on a machine under load
FX, BASELINE_M, CX, CY = 240.0, 0.12, 240.0, 135.0
# Rotation from the optical frame (z forward, x right) to base_link (x forward, y left).
OPTICAL = Quaternion(-0.5, 0.5, -0.5, 0.5)


@dataclass(frozen=True)
class ReportedTransition:
    """One extern transition that the node asked for."""

    at_ns: int
    resource: str
    to: str


class FakeFlight:
    """A context: simulated time, a hovering vehicle at ``position``, its sensors' mounts, and the skillset ``perception``.

    ``at_10_hz`` is called with the stamp whenever the sensors measure; it publishes what the test wants seen.
    """

    def __init__(self, node: str, *, height_m: float = 2.0) -> None:
        self.node = node
        self.now_ns = 100 * NS
        self.position = [0.0, 0.0, height_m]
        self.velocity = [0.0, 0.0, 0.0]
        self.target: tuple[float, float, float] | None = None
        self.at_10_hz: Callable[[int], None] = lambda _stamp_ns: None
        self.reports: list[ReportedTransition] = []
        self.health: list[SensorHealth] = []
        self._states = {"zed_status": "UNKNOWN", "lidar_status": "UNKNOWN"}
        self.reasons: dict[str, str] = {}
        self._steps = 0
        self._done = threading.Event()
        self._heard = threading.Event()
        self._measured = self._cut = False

    def __enter__(self) -> Self:
        """Go on simulated time and advertise everything."""
        self._sim_time_before = rospy.get_param("/use_sim_time", None)
        rospy.set_param("/use_sim_time", True)
        self._clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self._pose = rospy.Publisher("/uav_guidance/pose", PoseStamped, queue_size=100)
        self._state = rospy.Publisher("/uav_guidance/state", GuidanceState, queue_size=10)
        self._static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._images: dict[str, rospy.Publisher] = {}
        self._infos: dict[str, rospy.Publisher] = {}
        for side in ("left", "right"):
            self.start_driver(side)
        self._cloud = rospy.Publisher("/lidar/points", PointCloud2, queue_size=10)
        self._resources = rospy.Publisher("/perception/resource_states", ResourceStates, queue_size=10, latch=True)
        self._transition = rospy.Service("/perception/transition", Transition, self._on_transition)
        self._listener = rospy.Subscriber(f"/{self.node}/health", SensorHealth, self._on_health)
        self._done_listener = rospy.Subscriber(f"/{self.node}/done", Header, lambda _header: self._done.set())
        self._obstacle_listener = rospy.Subscriber(f"/{self.node}/obstacle", Obstacle, self._on_obstacle)
        self._static.publish(_mounts())
        self._publish_resources()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Take everything back, the node's parameters too."""
        self._transition.shutdown("the test is over")
        self._listener.unregister()
        self._done_listener.unregister()
        self._obstacle_listener.unregister()
        for publisher in (
            *(self._clock, self._pose, self._state, self._static, self._cloud, self._resources),
            *(*self._images.values(), *self._infos.values()),
        ):
            publisher.unregister()
        if rospy.has_param(f"/{self.node}"):
            rospy.delete_param(f"/{self.node}")
        if self._sim_time_before is None:
            rospy.delete_param("/use_sim_time")
        else:
            rospy.set_param("/use_sim_time", self._sim_time_before)

    def start_driver(self, side: str) -> None:
        """Advertise the images of one eye, and their infos."""
        self._images[side] = rospy.Publisher(f"/zed/{side}/image_raw", Image, queue_size=10)
        self._infos[side] = rospy.Publisher(f"/zed/{side}/camera_info", CameraInfo, queue_size=10)

    def drop_driver(self, side: str) -> None:
        """Take the images of one eye back."""
        for publisher in (self._images.pop(side), self._infos.pop(side)):
            publisher.unregister()

    def mount(self, transform: TransformStamped) -> None:
        """Mount one more sensor. Publishers of one process share the latched message of a topic, so all mounts are in one."""
        self._static.publish(TFMessage(transforms=[*_mounts().transforms, transform]))

    def connected(self) -> bool:
        """Whether the node listens, and its health is heard."""
        return bool(self.listens() and self._listener.get_num_connections())

    def listens(self) -> bool:
        """Whether the node listens to the clock and to the guidance."""
        return bool(self._clock.get_num_connections() and self._pose.get_num_connections())

    def run(self, seconds: float, *, until: Callable[[], object] = lambda: False) -> bool:
        """Let simulated time pass, at most so much, and return whether the condition came true.

        Time goes at most twice as fast as the wall clock, and waits for the node to be done with each measurement and to follow the
        clock: a slow machine makes a test longer, not different.
        """
        end_ns = self.now_ns + int(seconds * NS)
        pace = threading.Event()
        while self.now_ns < end_ns and not until():
            self._step()
            pace.wait(STEP_WALL_S)
        return bool(until())

    def _step(self) -> None:
        self.now_ns += STEP_NS
        self._steps += 1
        for axis in range(3):
            self.position[axis] += self.velocity[axis] * STEP_NS / NS
        stamp = rospy.Time(self.now_ns // NS, self.now_ns % NS)
        self._clock.publish(Clock(clock=stamp))
        pose = PoseStamped(header=Header(stamp=stamp, frame_id="map"))
        pose.pose.position, pose.pose.orientation = Point(*self.position), Quaternion(0.0, 0.0, 0.0, 1.0)
        self._pose.publish(pose)
        state = GuidanceState(header=Header(stamp=stamp), position_enu_m=Point(*self.position), velocity_enu_m_s=Vector3(*self.velocity))
        if self.target is not None:
            state.reference, state.target_enu_m = "position", Point(*self.target)
        self._state.publish(state)
        self._wait_for_health()  # else a measurement may come to a node whose clock is behind by more than it believes
        if self._steps % SENSOR_STEPS == 0:
            self._done.clear()
            self._measured = self._cut = False
            self.at_10_hz(self.now_ns)
            if self._measured:
                self._done.wait(LONGEST_WORK_WALL_S)
            self._wait_for_health()

    def _wait_for_health(self) -> None:
        """Let the node's timers follow the clock: a node that publishes its health does so each tenth of a second."""
        end_s = time.monotonic() + LONGEST_WORK_WALL_S
        while self.health and self.health[-1].header.stamp.to_nsec() <= self.now_ns - HEALTH_NS and time.monotonic() < end_s:
            self._heard.clear()
            self._heard.wait(STEP_WALL_S)

    def told_ns(self, verdict: int, *, after_ns: int) -> int:
        """Return when, on the node's own clock, its health first had this verdict after a moment; 0 if it has not yet."""
        stamps = (message.header.stamp.to_nsec() for message in list(self.health) if message.verdict == verdict)
        return next((stamp_ns for stamp_ns in stamps if stamp_ns > after_ns), 0)

    def _on_health(self, message: SensorHealth) -> None:
        self.health.append(message)
        self._heard.set()

    def _on_obstacle(self, message: Obstacle) -> None:
        """Of what can't be decoded a node knows no stamp that it could be done with; while it is enabled it says that it sees nothing."""
        if self._cut and message.unknown:
            self._done.set()

    def publish_image(self, side: str, stamp_ns: int, image: NDArray[np.uint8], *, encoding: str = "mono8", info_scale: int = 1) -> None:
        """Publish one image and its camera_info; ``info_scale`` makes that the one of a larger image."""
        header = Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id=f"zed_{side}")
        height, width = image.shape[:2]
        fx, cx, cy = FX * info_scale, CX * info_scale, CY * info_scale
        shift = -fx * BASELINE_M if side == "right" else 0.0
        info = CameraInfo(header=header, height=height * info_scale, width=width * info_scale)
        info.P = [fx, 0.0, cx, shift, 0.0, fx, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
        self._infos[side].publish(info)
        step, self._measured = image.strides[0], True
        self._images[side].publish(Image(header=header, height=height, width=width, encoding=encoding, step=step, data=image.tobytes()))

    def publish_cut_image(self, side: str, stamp_ns: int, image: NDArray[np.uint8]) -> None:
        """Send an image whose last bytes are missing, as a message of its own that is complete as far as its length says.

        The node is to be enabled.
        """
        header = Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id=f"zed_{side}")
        height, width = image.shape
        buffer = BytesIO()
        self._measured = self._cut = bool(self._obstacle_listener.get_num_connections())
        Image(header=header, height=height, width=width, encoding="mono8", step=width, data=image.tobytes()).serialize(buffer)
        send_raw(self._images[side], framed(buffer.getvalue()[:-100]))

    def publish_cloud(self, stamp_ns: int, points: NDArray[np.float32], times_s: NDArray[np.float32] | None = None) -> None:
        """Publish one cloud of the LiDAR, whose frame is base_link's moved up by 0.1 m; with the points' times since the stamp, if any."""
        self._measured = True
        message = cloud_message(Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id="lidar"), points, times_s)
        if times_s is not None:
            message.fields[-1].name = "time"
        self._cloud.publish(message)

    def publish_cut_cloud(self, stamp_ns: int, points: NDArray[np.float32]) -> None:
        """Send a cloud whose last bytes are missing, as a message of its own that is complete as far as its length says.

        The node is to be enabled.
        """
        buffer = BytesIO()
        self._measured = self._cut = bool(self._obstacle_listener.get_num_connections())
        cloud_message(Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id="lidar"), points).serialize(buffer)
        send_raw(self._cloud, framed(buffer.getvalue()[:-100]))

    def _on_transition(self, request: TransitionRequest) -> TransitionResponse:
        if self._states.get(request.resource) == request.to:  # no transition: a reason
            self.reasons[request.resource] = request.reason
            self._publish_resources()
            return TransitionResponse(accepted=False, reason="it is so already", state=request.to)
        self.reports.append(ReportedTransition(self.now_ns, request.resource, request.to))
        self._states[request.resource], self.reasons[request.resource] = request.to, request.reason
        self._publish_resources()
        return TransitionResponse(accepted=True, reason="", state=request.to)

    def _publish_resources(self) -> None:
        resources = [ResourceState(name=name, state=state, reason=self.reasons.get(name, "")) for name, state in self._states.items()]
        self._resources.publish(ResourceStates(skillset="perception", resources=resources))


def framed(data: bytes) -> bytes:
    """Return the bytes as TCPROS sends a message: behind their length."""
    return struct.pack("<I", len(data)) + data


def send_raw(publisher: rospy.Publisher, data: bytes) -> None:
    """Write bytes into each of a publisher's connections as they are."""
    for connection in publisher.impl.connections:
        connection.write_data(data)


def _mounts() -> TFMessage:
    zed = TransformStamped(header=Header(frame_id="base_link"), child_frame_id="zed_left")
    zed.transform.translation, zed.transform.rotation = Vector3(0.3, BASELINE_M / 2, 0.0), OPTICAL
    lidar = TransformStamped(header=Header(frame_id="base_link"), child_frame_id="lidar")
    lidar.transform.translation, lidar.transform.rotation = Vector3(0.0, 0.0, 0.1), Quaternion(0.0, 0.0, 0.0, 1.0)
    return TFMessage(transforms=[zed, lidar])
