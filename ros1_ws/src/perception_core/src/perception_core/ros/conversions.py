"""ROS 1 messages to numpy and back, without copies where possible. Debian's cv_bridge is tied to another numpy, so not by it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import rospy
from geometry_msgs.msg import Point
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header
from uav_msgs.msg import Obstacle

from perception_core.poses import NS
from perception_core.sweep import Sweep

if TYPE_CHECKING:
    from geometry_msgs.msg import Transform
    from numpy.typing import NDArray

    from perception_core.corridor import Nearest

_DTYPES = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}


def image_to_array(message: Image) -> NDArray[np.uint8]:
    """Return a mono8 image as (height, width) uint8, a view into the message; raise ValueError for another encoding or a short buffer."""
    if message.encoding != "mono8":
        raise ValueError(f"encoding {message.encoding!r}, expected 'mono8'")
    if len(message.data) < message.height * message.step or message.step < message.width:
        raise ValueError(f"{len(message.data)} bytes for {message.width}x{message.height} with a step of {message.step}")
    rows = np.frombuffer(message.data, dtype=np.uint8, count=message.height * message.step)
    return rows.reshape(message.height, message.step)[:, : message.width]


def depth_message(header: Header, depth_m: NDArray[np.float32]) -> Image:
    """Return a 32FC1 image."""
    height, width = depth_m.shape
    data = np.ascontiguousarray(depth_m, dtype="<f4").tobytes()
    return Image(header=header, height=height, width=width, encoding="32FC1", is_bigendian=0, step=4 * width, data=data)


def sweep_of_cloud(message: PointCloud2) -> Sweep:
    """Return the cloud's x, y, z and time; without a field ``time`` all points are of the stamp. Raises ValueError without x, y, z.

    Points that are not finite stay in; ``Sweep.within`` drops them together with their times.
    """
    order = ">" if message.is_bigendian else "<"
    fields = {field.name: (order + _DTYPES[field.datatype], field.offset) for field in message.fields if field.datatype in _DTYPES}
    if not {"x", "y", "z"} <= fields.keys():
        raise ValueError(f"the cloud has the fields {sorted(fields)}, expected x, y, z")
    names = [name for name in ("x", "y", "z", "time") if name in fields]
    layout = np.dtype(
        {
            "names": names,
            "formats": [fields[name][0] for name in names],
            "offsets": [fields[name][1] for name in names],
            "itemsize": message.point_step,
        }
    )
    count = message.width * message.height
    if len(message.data) < count * message.point_step:
        raise ValueError(f"{len(message.data)} bytes for {count} points of {message.point_step}")
    raw = np.frombuffer(message.data, dtype=layout, count=count)
    points = np.stack([raw["x"], raw["y"], raw["z"]], axis=1).astype(np.float32, copy=False)
    times = raw["time"].astype(np.float32) if "time" in names else np.zeros(count, dtype=np.float32)
    return Sweep(stamp_ns=message.header.stamp.to_nsec(), points=points, times_s=times)


def cloud_message(header: Header, points: NDArray[np.float32]) -> PointCloud2:
    """Return a cloud of x, y, z float32 from (N, 3)."""
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate("xyz")]
    data = np.ascontiguousarray(points, dtype="<f4").tobytes()
    return PointCloud2(
        header=header, height=1, width=len(points), fields=fields, point_step=12, row_step=12 * len(points), data=data, is_dense=True
    )


def matrix_of_transform(transform: Transform) -> NDArray[np.float64]:
    """Return a (4, 4) matrix."""
    q, t = transform.rotation, transform.translation
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    matrix[:3, 3] = [t.x, t.y, t.z]
    return matrix


def obstacle_message(stamp_ns: int, source: str, nearest: Nearest | None) -> Obstacle:
    """Return what one sensor says of one measurement: the nearest obstacle, or that none is seen."""
    stamp = rospy.Time(stamp_ns // NS, stamp_ns % NS)
    message = Obstacle(header=Header(stamp=stamp, frame_id="map"), source=source, detected=nearest is not None, distance_m=math.inf)
    if nearest is not None:
        message.distance_m = nearest.distance_m
        message.nearest_enu_m = Point(*nearest.point_enu_m)
    return message
