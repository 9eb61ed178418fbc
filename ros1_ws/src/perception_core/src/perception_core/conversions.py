"""Numpy arrays to ROS 1 messages, and transforms to matrices. Debian's cv_bridge is tied to another numpy, so not by it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from genpy import Time
from geometry_msgs.msg import Point, Vector3
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header
from uav_msgs.msg import Obstacle

from perception_core.poses import NS, rotation_of

if TYPE_CHECKING:
    from geometry_msgs.msg import Transform
    from numpy.typing import NDArray

    from perception_core.corridor import Nearest

UNIT_TOLERANCE = 1e-3
MAP, ODOMETRY = "map", "odom"
GUIDANCE_MAP = "guidance_map"
"""The map as the guidance flies by it: a child of `odom`, which follows the mapping's `map` at a bounded rate."""


def depth_message(header: Header, depth_m: NDArray[np.float32]) -> Image:
    """Return an image of encoding 32FC1 from depths (rows, columns) in metres; NaN where nothing is known."""
    height, width = depth_m.shape
    data = np.ascontiguousarray(depth_m, dtype="<f4").tobytes()
    return Image(header=header, height=height, width=width, encoding="32FC1", is_bigendian=0, step=4 * width, data=data)


def cloud_message(header: Header, points: NDArray[np.float32], confidence: NDArray[np.float32] | None = None) -> PointCloud2:
    """Return a cloud of x, y, z float32 from (N, 3), and of the points' ``confidence`` (N,) if there is one."""
    names = ["x", "y", "z"] + ([] if confidence is None else ["confidence"])
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate(names)]
    columns = points if confidence is None else np.column_stack([points, confidence])
    data = np.ascontiguousarray(columns, dtype="<f4").tobytes()
    step = 4 * len(names)
    return PointCloud2(
        header=header, height=1, width=len(points), fields=fields, point_step=step, row_step=step * len(points), data=data, is_dense=True
    )


def matrix_of_transform(transform: Transform) -> NDArray[np.float64]:
    """Return a (4, 4) matrix."""
    q, t = transform.rotation, transform.translation
    matrix = np.eye(4)
    length = math.hypot(q.x, q.y, q.z, q.w)
    matrix[:3, :3] = rotation_of(q.x / length, q.y / length, q.z / length, q.w / length)
    matrix[:3, 3] = [t.x, t.y, t.z]
    return matrix


def is_rigid(transform: Transform) -> bool:
    """Return whether it is a motion: a finite shift, a quaternion of unit length."""
    q, t = transform.rotation, transform.translation
    return bool(np.isfinite([t.x, t.y, t.z]).all() and abs(np.linalg.norm([q.x, q.y, q.z, q.w]) - 1.0) < UNIT_TOLERANCE)


def obstacle_message(stamp_ns: int, source: str, nearest: Nearest | None, unknown: str = "") -> Obstacle:
    """Return one sensor's verdict on one measurement: the nearest obstacle or none, and why no more is known of the corridor."""
    stamp = Time(stamp_ns // NS, stamp_ns % NS)
    message = Obstacle(header=Header(stamp=stamp, frame_id=ODOMETRY), source=source, detected=nearest is not None, distance_m=math.inf)
    if nearest is not None:
        message.distance_m = nearest.distance_m
        message.nearest_enu_m = Point(*nearest.point_enu_m)
        message.size_m = Vector3(*nearest.size_m)
    message.unknown, message.reason = bool(unknown), unknown
    return message
