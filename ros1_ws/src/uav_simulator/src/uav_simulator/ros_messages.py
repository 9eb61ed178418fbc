"""Turn the simulation's values into ROS messages: stamps, frames, bytes, nothing else."""

from __future__ import annotations

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Quaternion, TransformStamped, Vector3
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, Imu, PointCloud2, PointField
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from uav_simulator.frames import Quat
from uav_simulator.sensors.imu import ACCEL_NOISE_M_S2, GYRO_NOISE_RAD_S, ImuReading
from uav_simulator.sensors.lidar import POINT_DTYPE
from uav_simulator.sensors.mounts import CAMERA, MOUNTS, ZED_LEFT
from uav_simulator.sensors.pose_track import Pose
from uav_simulator.sensors.stereo import Pinhole

MAP, BASE_LINK = "map", "base_link"


def ros_time(stamp_ns: int) -> rospy.Time:
    """Return a stamp of integer nanoseconds."""
    return rospy.Time(*divmod(stamp_ns, 1_000_000_000))


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header with this stamp (mission clock) and frame."""
    return Header(stamp=ros_time(stamp_ns), frame_id=frame_id)


def quaternion(q: Quat) -> Quaternion:
    """Return (w, x, y, z) in ROS's order."""
    return Quaternion(x=q[1], y=q[2], z=q[3], w=q[0])


def pose_stamped(pose: Pose, stamp_ns: int) -> PoseStamped:
    """Return the true pose in map."""
    message = PoseStamped(header=header(stamp_ns, MAP))
    p = message.pose.position
    p.x, p.y, p.z = pose.position
    message.pose.orientation = quaternion(pose.attitude)
    return message


def image(pixels: NDArray[np.uint8], stamp_ns: int) -> Image:
    """Return a mono8 image; both eyes are in the left one's frame, as rectified pairs are."""
    height, width = pixels.shape
    return Image(
        header=header(stamp_ns, ZED_LEFT.frame_id),
        height=height,
        width=width,
        encoding="mono8",
        is_bigendian=0,
        step=width,
        data=pixels.tobytes(),
    )


def colour_image(pixels: NDArray[np.uint8], stamp_ns: int) -> Image:
    """Return an rgb8 image of the inspection camera, (H, W, 3)."""
    height, width = pixels.shape[:2]
    message = Image(header=header(stamp_ns, CAMERA.frame_id), height=height, width=width, encoding="rgb8", step=3 * width)
    message.data = pixels.tobytes()
    return message


def camera_info(camera: Pinhole, *, right: bool, stamp_ns: int) -> CameraInfo:
    """Return the intrinsics; the right eye's P[3] is -fx times the baseline."""
    f, (cx, cy) = camera.focal_px, camera.centre_px
    shift = -f * camera.baseline_m if right else 0.0
    return CameraInfo(
        header=header(stamp_ns, ZED_LEFT.frame_id),
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        D=[0.0] * 5,
        K=[f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[f, 0.0, cx, shift, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def cloud(points: NDArray[np.void], stamp_ns: int) -> PointCloud2:
    """Return a cloud whose stamp is the sweep's beginning; `time` of each point counts from it."""
    names = POINT_DTYPE.names or ()
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate(names)]
    return PointCloud2(
        header=header(stamp_ns, "lidar"),
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=POINT_DTYPE.itemsize,
        row_step=POINT_DTYPE.itemsize * len(points),
        is_dense=True,
        data=points.tobytes(),
    )


def imu(reading: ImuReading, stamp_ns: int) -> Imu:
    """Return an IMU message without an orientation."""
    message = Imu(header=header(stamp_ns, BASE_LINK))
    message.angular_velocity = Vector3(*reading.rates)
    message.linear_acceleration = Vector3(*reading.specific_force)
    message.orientation_covariance[0] = -1.0  # sensor_msgs/Imu: no orientation estimate
    gyro, accel = GYRO_NOISE_RAD_S**2, ACCEL_NOISE_M_S2**2
    message.angular_velocity_covariance = [gyro, 0.0, 0.0, 0.0, gyro, 0.0, 0.0, 0.0, gyro]
    message.linear_acceleration_covariance = [accel, 0.0, 0.0, 0.0, accel, 0.0, 0.0, 0.0, accel]
    return message


def static_transforms(stamp_ns: int) -> TFMessage:
    """Return T_base_link_sensor of all sensors."""
    transforms = []
    for mount in MOUNTS:
        transform = TransformStamped(header=header(stamp_ns, BASE_LINK), child_frame_id=mount.frame_id)
        transform.transform.translation = Vector3(*mount.translation)
        transform.transform.rotation = quaternion(mount.rotation)
        transforms.append(transform)
    return TFMessage(transforms=transforms)
