"""The guidance's values as ROS messages and back."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState, Obstacle

from perception_core.conversions import GUIDANCE_MAP, MAP, ODOMETRY
from uav_guidance.frames import turned, turned_about_vertical
from uav_guidance.guidance import GuidanceStatus
from uav_guidance.localization import Correction, Transform
from uav_guidance.obstacles import Sighting
from uav_guidance.vectors import Vec3
from uav_guidance.vehicle import VehicleSnapshot, mode_name

BODY = "base_link"
NO_TURN = (0.0, 0.0, 0.0, 1.0)


def time_of(stamp_ns: int) -> rospy.Time:
    """Return nanoseconds as a rospy.Time."""
    return rospy.Time(*divmod(stamp_ns, 1_000_000_000))


def vec3(point: Point) -> Vec3:
    """Return a point as a vector."""
    return Vec3(point.x, point.y, point.z)


def sighting(message: Obstacle, correction: Correction) -> Sighting:
    """Return a sensor's verdict on the corridor ahead, in `map`: sensors are straightened along the autopilot's motion, in `odom`."""
    nearest = vec3(message.nearest_enu_m)
    return Sighting(
        source=message.source,
        stamp_s=message.header.stamp.to_sec(),
        detected=message.detected,
        distance_m=message.distance_m,
        nearest_enu_m=correction.to_map(nearest) if frame(message.header) == ODOMETRY else nearest,
        unknown=message.unknown,
    )


def frame(header: Header) -> str:
    """Return the frame's name; some drivers write it with a slash."""
    return str(header.frame_id).lstrip("/")


def map_to_odom(message: TFMessage) -> Transform | None:
    """Return the mapping's T_map_odom if the message has it."""
    for item in message.transforms:
        if (frame(item.header), item.child_frame_id.lstrip("/")) == (MAP, ODOMETRY):
            t, q = item.transform.translation, item.transform.rotation
            return Transform((q.x, q.y, q.z, q.w), Vec3(t.x, t.y, t.z))
    return None


def state_message(report: GuidanceStatus, stamp: rospy.Time) -> GuidanceState:
    """Return the guidance's state as a message."""
    vehicle, course, remaining = report.vehicle, report.course, report.course.remaining_enu_m
    place, velocity, target = vehicle.position_enu_m or Vec3(), vehicle.velocity_enu_m_s, course.target_enu_m
    message = GuidanceState(
        link=report.link,
        ready=vehicle.ready,
        armed=vehicle.armed,
        mode=mode_name(vehicle.mode),
        landed_state=int(vehicle.landed),
        authority=report.authority,
        home_valid=vehicle.home is not None,
        position_enu_m=Point(place.x, place.y, place.z),
        velocity_enu_m_s=Vector3(velocity.x, velocity.y, velocity.z),
        yaw_rad=vehicle.yaw_rad,
        reference=course.reference,
        reference_id=report.reference_id,
        target_enu_m=Point(target.x, target.y, target.z),
        target_yaw_rad=course.target_yaw_rad,
        distance_to_go_m=remaining.norm,
        horizontal_to_go_m=remaining.horizontal,
        vertical_to_go_m=abs(remaining.z),
        drift_m=course.drift_m,
        heading_error_rad=course.heading_error_rad,
        heading_locked=course.heading_locked,
        still_s=course.still_s,
        obstacle_stop=course.obstacle_stop,
        obstacle_m=course.obstacle_m,
        unwatched=course.unwatched,
    )
    message.header.stamp = stamp
    message.header.frame_id = MAP
    return message


def pose_message(vehicle: VehicleSnapshot, stamp: rospy.Time) -> PoseStamped | None:
    """Return the autopilot's pose in `odom`, at the moment of the position; the attitude, a few ms older or newer, is turned on to it."""
    if vehicle.position_enu_m is None or vehicle.quat_xyzw is None:
        return None
    apart_s = min(max((vehicle.boot_ms - vehicle.attitude_boot_ms) * 1e-3, -0.05), 0.05)
    message = PoseStamped()
    message.header.stamp = stamp
    message.header.frame_id = ODOMETRY
    place = vehicle.position_enu_m
    message.pose.position = Point(place.x, place.y, place.z)
    message.pose.orientation = Quaternion(*turned(vehicle.quat_xyzw, vehicle.rates_flu_rad_s, apart_s))
    return message


def transform_message(pose: PoseStamped) -> TFMessage:
    """Return the pose as a transform from odom to base_link; that from map to odom is the SLAM's."""
    transform = TransformStamped(header=Header(stamp=pose.header.stamp, frame_id=ODOMETRY), child_frame_id=BODY)
    place = pose.pose.position
    transform.transform.translation = Vector3(place.x, place.y, place.z)
    transform.transform.rotation = pose.pose.orientation
    return TFMessage(transforms=[transform])


def correction_message(correction: Correction, stamp: rospy.Time) -> TFMessage:
    """Return where the map that the guidance flies by lies in `odom`: a frame of its own, for it follows `map` at a bounded rate."""
    transform = TransformStamped(header=Header(stamp=stamp, frame_id=ODOMETRY), child_frame_id=GUIDANCE_MAP)
    origin = correction.to_odom(Vec3())
    transform.transform.translation = Vector3(origin.x, origin.y, origin.z)
    transform.transform.rotation = Quaternion(*turned_about_vertical(NO_TURN, -correction.yaw_rad))
    return TFMessage(transforms=[transform])
