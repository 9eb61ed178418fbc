"""The functional layer as the skills see it through the bridge, faked on rclpy: services, states, obstacles, a clock.

The mission clock runs five times as fast as the wall clock, and waits for nodes that have not heard it: on a busy machine it is slower.
The vehicle is a point that goes where it is told.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from skillset_interfaces.srv import Transition
from std_srvs.srv import SetBool, Trigger
from uav_msgs.msg import GuidanceState, MappingState, Obstacle, VideoState
from uav_msgs.srv import Command, SetHeadingReference, SetPositionReference, Stream, Takeoff

STEP_S = 0.05  # of mission clock
WALL_STEP_S = 0.01
CLIMB_M_S = 4.0
STEP_M = 0.2
LONG_WAY_STEP_M = 0.004
AHEAD_S = 0.2
"""So far the clock may be ahead of what the slowest node has heard of it."""
YAW_STEP_RAD = 0.1


@dataclass
class Vehicle:
    """What the guidance would say; tests may push it about."""

    place: list = field(default_factory=lambda: [0.0, 0.0, 0.0])
    step_m: float = STEP_M
    yaw: float = 0.0
    armed: bool = False
    reference: str = "idle"
    reference_id: int = 0
    target: list = field(default_factory=lambda: [0.0, 0.0, 0.0])
    target_yaw: float = 0.0
    locked: bool = False
    stuck: bool = False
    still_s: float = 0.0
    drift_m: float = 0.0
    silent: bool = False
    refuse: str = ""

    @property
    def in_air(self) -> bool:
        return self.place[2] > 0.05

    def distance(self) -> float:
        return math.dist(self.place, self.target) if self.reference in {"takeoff", "position"} else 0.0

    def heading_error(self) -> float:
        return math.remainder(self.target_yaw - self.yaw, math.tau) if self.reference == "heading" or self.locked else 0.0

    def step(self) -> None:
        if self.reference == "land":
            self.place[2] = max(0.0, self.place[2] - CLIMB_M_S * STEP_S)
            self.armed = self.in_air
        elif self.reference in {"takeoff", "position"} and not self.stuck:
            distance = self.distance()
            part = 1.0 if distance < self.step_m else self.step_m / distance
            self.place = [here + part * (there - here) for here, there in zip(self.place, self.target, strict=True)]
        error = self.heading_error()
        if not self.stuck:
            self.yaw += math.copysign(min(abs(error), YAW_STEP_RAD), error)
        waits = self.stuck and (self.distance() > self.step_m or abs(error) > YAW_STEP_RAD)
        self.still_s = self.still_s + STEP_S if waits else 0.0


class FakeFunctional:
    """Runs in threads of its own; ``calls`` has every service call in order; ``heard_s()`` is the clock of the slowest node."""

    def __init__(self, heard_s: Callable[[], float], context=None) -> None:
        self._heard_s = heard_s
        self.vehicle = Vehicle()
        self.calls: list = []
        self.enabled: dict[str, bool] = {}
        self.mute: set[str] = set()
        self.now_s = 100.0
        self.reports_flight = False
        self._reported_air = False
        self._scans = 0
        self._lock = threading.RLock()
        self.node = Node("fake_functional", context=context)
        group = ReentrantCallbackGroup()
        self._clock = self.node.create_publisher(ClockMessage, "/clock", 10)
        self._state = self.node.create_publisher(GuidanceState, "/uav_guidance/state", 10)
        self._obstacles = {name: self.node.create_publisher(Obstacle, f"/{name}/obstacle", 10) for name in ("zed_depth", "lidar_obstacles")}
        self._mapping = self.node.create_publisher(MappingState, "/lidar_mapping/state", 10)
        self._video = self.node.create_publisher(VideoState, "/video_stream/state", 10)
        for name, kind, handler in (
            ("takeoff", Takeoff, self._takeoff),
            ("set_position", SetPositionReference, self._set_position),
            ("set_heading", SetHeadingReference, self._set_heading),
            ("hover", Command, lambda _request: self._follow("hover")),
            ("land", Command, lambda _request: self._follow("land")),
        ):
            self.node.create_service(kind, f"/uav_guidance/{name}", self._served(name, handler), callback_group=group)
        for name in ("zed_depth", "lidar_obstacles", "lidar_mapping"):
            self.node.create_service(SetBool, f"/{name}/enable", self._enabler(name), callback_group=group)
        self.node.create_service(Stream, "/video_stream/stream", self._stream, callback_group=group)
        self.node.create_service(Trigger, "/lidar_mapping/save", self._save, callback_group=group)
        self._transitions = {
            name: self.node.create_client(Transition, f"/{name}/transition", callback_group=group)
            for name in ("navigation", "perception", "video")
        }
        self.node.create_timer(WALL_STEP_S, self._tick, callback_group=group, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.executor = MultiThreadedExecutor(num_threads=2, context=context)
        self.executor.add_node(self.node)
        self._thread = threading.Thread(target=self.executor.spin, daemon=True)
        self._thread.start()

    def reset(self) -> None:
        with self._lock:
            # As of one guidance: what it has said of an earlier reference, and a node hears late, is not taken for news of the next.
            self.vehicle = Vehicle(reference_id=self.vehicle.reference_id)
            self.calls.clear()
            self.enabled.clear()
            self.mute.clear()
            self.reports_flight = self._reported_air = False

    def fly_at(self, x: float, y: float, z: float) -> None:
        with self._lock:
            self.vehicle.place, self.vehicle.armed = [x, y, z], True

    def report(self, skillset: str, resource: str, to: str, reason: str = ""):
        """Ask for an extern transition; return the future of its response."""
        return self._transitions[skillset].call_async(Transition.Request(resource=resource, to=to, reason=reason))

    def names(self) -> list[str]:
        with self._lock:
            return [name for name, _request in self.calls]

    def close(self) -> None:
        self.executor.shutdown(timeout_sec=2.0)
        self._thread.join(timeout=3.0)
        self.node.destroy_node()

    # --- services ----------------------------------------------------------------------------------------------------

    def _served(self, name, handler):
        def serve(request, response):
            with self._lock:
                self.calls.append((name, request))
                if self.vehicle.refuse:
                    response.accepted, response.reason = False, self.vehicle.refuse
                else:
                    response.accepted, response.reference_id = True, handler(request)
            return response

        return serve

    def _follow(self, reference: str, target=None) -> int:
        vehicle = self.vehicle
        vehicle.reference, vehicle.target = reference, list(target or vehicle.place)
        vehicle.reference_id += 1
        vehicle.still_s = 0.0
        return vehicle.reference_id

    def _takeoff(self, request) -> int:
        self.vehicle.armed = True
        return self._follow("takeoff", [*self.vehicle.place[:2], request.height_m])

    def _set_position(self, request) -> int:
        return self._follow("position", [request.target_enu_m.x, request.target_enu_m.y, request.target_enu_m.z])

    def _set_heading(self, request) -> int:
        if request.release:
            self.vehicle.locked = False
            return self.vehicle.reference_id
        self.vehicle.target_yaw, self.vehicle.locked = request.yaw_rad, request.lock
        return self.vehicle.reference_id if request.lock else self._follow("heading")

    def _enabler(self, name):
        def enable(request, response):
            with self._lock:
                self.calls.append((f"{name}.enable", request.data))
                self.enabled[name] = request.data
            response.success = True
            return response

        return enable

    def _stream(self, request, response):
        with self._lock:
            self.calls.append(("stream", request.on))
            self.enabled["video_stream"] = request.on
        response.accepted = True
        return response

    def _save(self, _request, response):
        with self._lock:
            self.calls.append(("save", None))
        response.success = True
        return response

    # --- what goes on ------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        if self.now_s - self._heard_s() > AHEAD_S:
            self._clock.publish(ClockMessage(clock=self._stamp()))  # told again: it may have got lost
            return
        with self._lock:
            self.now_s += STEP_S
            self.vehicle.step()
            if self.reports_flight and self.vehicle.in_air is not self._reported_air:
                self._reported_air = self.vehicle.in_air
                self.report("navigation", "flight_status", "IN_AIR" if self._reported_air else "ON_GROUND")
            stamp = self._stamp()
            state = None if self.vehicle.silent else self._state_message(stamp)
            watching = [name for name in self._obstacles if self.enabled.get(name) and name not in self.mute]
            mapping = self.enabled.get("lidar_mapping") and "lidar_mapping" not in self.mute
            self._scans += bool(mapping)
            video = None if "video_stream" in self.mute else VideoState(streaming=self.enabled.get("video_stream", False), fps=20.0)
        self._clock.publish(ClockMessage(clock=stamp))
        if state is not None:
            self._state.publish(state)
        for name in watching:
            self._obstacles[name].publish(Obstacle(source=name, distance_m=math.inf))
        if mapping:
            self._mapping.publish(MappingState(running=True, scans=self._scans))
        if video is not None:
            video.header.stamp = stamp
            self._video.publish(video)

    def _stamp(self) -> Time:
        return Time(sec=int(self.now_s), nanosec=int(self.now_s % 1.0 * 1e9))

    def _state_message(self, stamp) -> GuidanceState:
        vehicle = self.vehicle
        x, y, z = vehicle.place
        message = GuidanceState(
            armed=vehicle.armed,
            authority=True,
            landed_state=GuidanceState.IN_AIR if vehicle.in_air else GuidanceState.ON_GROUND,
            position_enu_m=Point(x=x, y=y, z=z),
            reference=vehicle.reference,
            reference_id=vehicle.reference_id,
            distance_to_go_m=vehicle.distance(),
            vertical_to_go_m=abs(vehicle.target[2] - z),
            drift_m=vehicle.drift_m,
            heading_error_rad=vehicle.heading_error(),
            heading_locked=vehicle.locked,
            still_s=vehicle.still_s,
            obstacle_m=math.inf,
        )
        message.header.stamp = stamp
        return message
