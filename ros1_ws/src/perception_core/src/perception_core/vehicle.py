"""The vehicle for the perception nodes: its poses, its motion, and where its sensors are mounted."""

from __future__ import annotations

from threading import Condition
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import PoseStamped
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState

from node_core.core import Input
from perception_core.conversions import GUIDANCE_MAP, is_rigid, matrix_of_transform
from perception_core.corridor import VehicleMotion
from perception_core.poses import PoseBuffer

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

BUFFER_BYTES = 1 << 16
TRANSFORMS_WAITING = 50  # the vehicle's pose comes on the same topic, at 50 Hz, which is of no interest here
POSES_KEPT_S = 3.0
BASE = "base_link"
LONGEST_CHAIN = 16  # of frames between a sensor and base_link; longer is a loop
POSE_WAIT_S = 0.3  # wall clock; poses come at 50 Hz


class KnownVehicle:
    """The vehicle by the guidance and ``/tf_static``; the attributes are always the latest.

    All is in the autopilot's frame `odom`, which no correction of the map makes jump: ``poses`` come in it, ``motion`` is turned into it.
    """

    def __init__(self) -> None:
        self.poses = PoseBuffer(keep_s=POSES_KEPT_S)
        self.motion = VehicleMotion()
        self._T_odom_map: NDArray[np.float64] | None = None
        self._map_told = Condition()
        self._mounts: dict[str, tuple[str, NDArray[np.float64]]] = {}  # of each frame its parent and T_parent_frame

    def inputs(self, garbage: Callable[[str], None]) -> list[Input]:
        """Return the topics about the vehicle; reasons of undecodable messages go to ``garbage``."""
        return [
            Input("/uav_guidance/pose", PoseStamped, self._on_pose, garbage, BUFFER_BYTES, queue_size=50),
            Input("/uav_guidance/state", GuidanceState, self._on_state, garbage, BUFFER_BYTES),
            Input("/tf", TFMessage, self._on_transforms, garbage, BUFFER_BYTES, TRANSFORMS_WAITING, about=GUIDANCE_MAP.encode()),
            Input("/tf_static", TFMessage, self._on_static, garbage, BUFFER_BYTES, queue_size=10),
        ]

    def poses_at(self, stamp_ns: int) -> PoseBuffer:
        """Return the poses, those up to ``stamp_ns`` included unless they are later than `POSE_WAIT_S`; may block for that long."""
        self.poses.wait_for(stamp_ns, timeout_s=POSE_WAIT_S)
        return self.poses

    def T_odom_map(self, *, wait_s: float = 0.0) -> NDArray[np.float64] | None:  # noqa: N802 -- T_target_source
        """Return T_odom_map of the map by which the guidance flies, (4, 4); None where none is received within ``wait_s`` (wall clock)."""
        with self._map_told:
            self._map_told.wait_for(lambda: self._T_odom_map is not None, wait_s)
            return self._T_odom_map

    def mount(self, frame: str) -> NDArray[np.float64]:
        """Return T_base_sensor, (4, 4); raise LookupError before ``/tf_static`` has it."""
        name, T_base_sensor = frame.lstrip("/"), np.eye(4)  # noqa: N806 -- T_target_source
        for _ in range(LONGEST_CHAIN):
            if name == BASE:
                return T_base_sensor
            if name not in self._mounts:
                break
            name, T_parent_child = self._mounts[name]  # noqa: N806
            T_base_sensor = T_parent_child @ T_base_sensor  # noqa: N806
        raise LookupError(f"/tf_static has no transform from base_link to {frame!r} (known: {sorted(self._mounts)})")

    def _on_pose(self, message: PoseStamped) -> None:
        p, q = message.pose.position, message.pose.orientation
        self.poses.add(message.header.stamp.to_nsec(), (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

    def _on_state(self, message: GuidanceState) -> None:
        v, t, told = message.velocity_enu_m_s, message.target_enu_m, self.T_odom_map()
        T_odom_map = np.eye(4) if told is None else told  # noqa: N806 -- T_target_source
        vx, vy, vz = (float(part) for part in T_odom_map[:3, :3] @ (v.x, v.y, v.z))
        tx, ty, tz = (float(part) for part in (T_odom_map @ (t.x, t.y, t.z, 1.0))[:3])
        self.motion = VehicleMotion(velocity_enu_m_s=(vx, vy, vz), target_enu_m=(tx, ty, tz) if message.reference == "position" else None)

    def _on_transforms(self, message: TFMessage) -> None:
        for item in message.transforms:
            if item.child_frame_id.lstrip("/") == GUIDANCE_MAP and is_rigid(item.transform):
                with self._map_told:
                    self._T_odom_map = matrix_of_transform(item.transform)
                    self._map_told.notify_all()

    def _on_static(self, message: TFMessage) -> None:
        for item in message.transforms:
            self.set_mount(item.header.frame_id, item.child_frame_id, matrix_of_transform(item.transform))

    def set_mount(self, parent: str, frame: str, T_parent_frame: NDArray[np.float64]) -> None:  # noqa: N803 -- T_target_source
        """Set the place of a frame on its parent, (4, 4)."""
        self._mounts[frame.lstrip("/")] = parent.lstrip("/"), T_parent_frame
