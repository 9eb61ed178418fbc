"""The functional layer as objects: what the paper's Listing 4 calls ``dji_guidance``.

Each class wraps topics and services of one part (docs/reference/drone.md) on an rclpy node. Commands return at once, their
answer comes to a callback; reports are kept and passed on to listeners.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Any

from geometry_msgs.msg import Point
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from skillset_interfaces.msg import ResourceStates
from std_srvs.srv import SetBool, Trigger
from uav_msgs.msg import GuidanceState, MappingState, Obstacle, VideoState
from uav_msgs.srv import Command, SetHeadingReference, SetPositionReference, Stream, Takeoff

from skillset_ros2 import QUIET, SlowerClock, Watch
from uav_skills.calls import CallQueue, Reply, ignore_response

WATCH_PERIOD_S = 0.1
LONGEST_STEP_S = 0.2
MOTIONS = ("position", "heading")  # references that move the vehicle, and that may be stopped at any time
LAST_FEW = QoSProfile(depth=10)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def watch_of(node: Node) -> Watch:
    """Make the timer that parts of a node share: each timer of its own wakes the executor at another moment."""
    return Watch(node, WATCH_PERIOD_S, callback_group=ReentrantCallbackGroup())


class FunctionalPart:
    """One part of the functional layer: a queue of calls, and a watch that notices when nothing is heard.

    ``clock`` is what ``watch_of`` has made, where several parts of a node share it. ``now_s`` is mission clock without its jumps: when
    the clock itself did not come through for a while (the bridge was started again), nothing else came either, and what was not heard
    meanwhile must not count as silent. It may stand while no watcher is needed and no call is without a response. Watchers count it: the
    vehicle moves by it, so two seconds without a depth map are two seconds of flight that nobody looks ahead, however slow the machine.
    Calls count the slower one of it and the monotonic clock ``steady_s``.
    """

    def __init__(self, node: Node, clock: Watch | None = None, steady_s: Callable[[], float] = time.monotonic) -> None:
        self.now_s = 0.0
        self._node = node
        self._group = ReentrantCallbackGroup()
        self._clock = clock or watch_of(node)
        self._clock_s = self._clock.now_s
        self._slower = SlowerClock(lambda: self.now_s, steady_s)
        self._calls = CallQueue(lambda: self._slower.now_s)
        self._watchers: list[tuple[Callable[[], None], Callable[[], bool]]] = []
        self._clock.every(self._watch, lambda: self._calls.pending or any(needed() for _, needed in self._watchers))

    def watch(self, watcher: Callable[[], None], needed: Callable[[], bool]) -> None:
        """Call ``watcher`` ten times a second of mission clock, while ``needed()``; it takes no lock. Then call ``wake``."""
        self._watchers.append((watcher, needed))

    def wake(self) -> None:
        """Watch: something is needed now."""
        self._clock.wake()

    def _watch(self) -> None:
        clock_s = self._clock.now_s
        self.now_s += min(max(clock_s - max(self._clock_s, self._clock.awake_since_s), 0.0), LONGEST_STEP_S)
        self._clock_s = clock_s
        self._slower.look()
        self._calls.tick()
        for watcher, _ in self._watchers:
            watcher()

    def _submit(self, service: Any, request: object, reply: Reply = ignore_response) -> None:
        """Call a service in its turn, and watch until it has answered."""
        self._calls.submit(service, request, reply)
        self.wake()

    def _client(self, service_type: Any, name: str) -> Any:
        return self._node.create_client(service_type, name, callback_group=self._group)

    def _subscribe(self, message_type: Any, topic: str, callback: Callable[[Any], None], qos: QoSProfile = LAST_FEW) -> None:
        # The data manager, which has most of these topics, too, gets rclpy's warnings; each is an entity that every turn gathers.
        self._node.create_subscription(message_type, topic, callback, qos, callback_group=self._group, event_callbacks=QUIET)


class GuidanceApi(FunctionalPart):
    """The guidance: references for position and heading, and what it says about following them.

    A motion that is under way when this begins was started by managers that are gone: it is not watched, so it is stopped.
    ``orphans``: the references that this process may have started before; others are watched elsewhere.
    """

    def __init__(self, node: Node, orphans: Collection[str] = MOTIONS) -> None:
        super().__init__(node)
        self._orphans = orphans
        self.state: GuidanceState | None = None
        self.heard_s: float | None = None
        self._listeners: list[Callable[[GuidanceState], None]] = []
        self._takeoff = self._client(Takeoff, "uav_guidance/takeoff")
        self._position = self._client(SetPositionReference, "uav_guidance/set_position")
        self._heading = self._client(SetHeadingReference, "uav_guidance/set_heading")
        self._hover = self._client(Command, "uav_guidance/hover")
        self._land = self._client(Command, "uav_guidance/land")
        self._subscribe(GuidanceState, "uav_guidance/state", self._on_state)

    def listen(self, listener: Callable[[GuidanceState], None]) -> None:
        """Pass every state on to ``listener``."""
        self._listeners.append(listener)

    def takeoff(self, *, height_m: float, speed_m_s: float, reply: Reply) -> None:
        """Climb to a height above home."""
        self._submit(self._takeoff, Takeoff.Request(height_m=height_m, speed_m_s=speed_m_s), reply)

    def set_position(self, *, target_enu_m: Point, speed_m_s: float, along_travel: bool, reply: Reply) -> None:
        """Fly to a point, the nose along the travel or kept where the heading reference wants it."""
        kinds = SetPositionReference.Request
        heading = kinds.ALONG_TRAVEL if along_travel else kinds.KEEP
        self._submit(self._position, kinds(target_enu_m=target_enu_m, speed_m_s=speed_m_s, heading=heading), reply)

    def set_heading(self, *, heading_rad: float, rate_rad_s: float, lock: bool, reply: Reply) -> None:
        """Turn on the spot, or hold a heading while position references move the vehicle."""
        request = SetHeadingReference.Request(yaw_rad=heading_rad, rate_rad_s=rate_rad_s, lock=lock)
        self._submit(self._heading, request, reply)

    def release_heading(self, reply: Reply = ignore_response) -> None:
        """End the holding of a heading."""
        self._submit(self._heading, SetHeadingReference.Request(release=True), reply)

    def hover(self, reply: Reply = ignore_response) -> None:
        """Stop the motion and hold the position."""
        self._submit(self._hover, Command.Request(), reply)

    def land(self, reply: Reply) -> None:
        """Land where the vehicle is."""
        self._submit(self._land, Command.Request(), reply)

    def _on_state(self, state: GuidanceState) -> None:
        if self.state is None and state.reference in MOTIONS and state.reference in self._orphans:
            self.hover()
        self.state, self.heard_s = state, self.now_s
        for listener in self._listeners:
            listener(state)


class DepthApi(FunctionalPart):
    """A sensor that looks ahead: ``node_name`` is zed_depth or lidar_obstacles."""

    def __init__(self, node: Node, node_name: str, clock: Watch | None = None) -> None:
        super().__init__(node, clock)
        self.heard_s: float | None = None
        self._enable = self._client(SetBool, f"{node_name}/enable")
        self._subscribe(Obstacle, f"{node_name}/obstacle", self._on_obstacle)

    def enable(self, *, on: bool, reply: Reply = ignore_response) -> None:
        """Start or stop the obstacle detection."""
        self._submit(self._enable, SetBool.Request(data=on), reply)

    def _on_obstacle(self, _obstacle: Obstacle) -> None:
        """Hear of the sensor, also where it can't judge the way: the guidance does not move on then."""
        self.heard_s = self.now_s


class MappingApi(FunctionalPart):
    """Services and state of the LiDAR mapping node."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self.state: MappingState | None = None
        self.registered_s: float | None = None
        self._enable = self._client(SetBool, "lidar_mapping/enable")
        self._save = self._client(Trigger, "lidar_mapping/save")
        self.lidar_fault = ""
        """Why the LiDAR is not believed; empty when it is well."""
        self._subscribe(MappingState, "lidar_mapping/state", self._on_state)
        self._subscribe(ResourceStates, "perception/resource_states", self._on_perception, LATCHED)

    def enable(self, *, on: bool, reply: Reply = ignore_response) -> None:
        """Start or stop the registration of scans."""
        self._submit(self._enable, SetBool.Request(data=on), reply)

    def save(self, reply: Reply = ignore_response) -> None:
        """Have the node write the map to its file."""
        self._submit(self._save, Trigger.Request(), reply)

    def _on_state(self, state: MappingState) -> None:
        if self.state is None or state.scans != self.state.scans:
            self.registered_s = self.now_s
        self.state = state

    def _on_perception(self, states: ResourceStates) -> None:
        self.lidar_fault = next((str(one.reason) for one in states.resources if one.name == "lidar_status"), "")


class VideoApi(FunctionalPart):
    """The video to the telepilot."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self.seen_s: float | None = None
        """When the telepilot was last known to see pictures."""
        self.sending_s: float | None = None
        """When the encoder last said that it sends."""
        self.told_idle = False
        """Whether it said last that it doesn't."""
        self._stream = self._client(Stream, "video_stream/stream")
        self._subscribe(VideoState, "video_stream/state", self._on_state)

    def begin(self, *, min_fps: float, min_quality: float, patience_s: float, reply: Reply) -> None:
        """Send, with what the telepilot needs at least."""
        request = Stream.Request(on=True, min_fps=min_fps, min_quality=min_quality, patience_s=patience_s)
        self._submit(self._stream, request, reply)

    def stop(self, reply: Reply = ignore_response) -> None:
        """Have the node end the stream."""
        self._submit(self._stream, Stream.Request(), reply)

    def _on_state(self, state: VideoState) -> None:
        self.told_idle = not state.streaming
        if state.streaming:
            self.sending_s = self.now_s
            self.seen_s = self.now_s if state.fps > 0.0 else self.seen_s
