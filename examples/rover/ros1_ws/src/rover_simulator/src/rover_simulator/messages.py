"""From what is simulated to ROS messages. Frames: map, odom, base_link, laser."""

from __future__ import annotations

import math

import rospy
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, LaserScan
from std_msgs.msg import Header

from rover_simulator.battery import Battery
from rover_simulator.floor import Sweep
from rover_simulator.wheels import Pose


def ros_time(stamp_ns: int) -> rospy.Time:
    """Return a stamp of integer nanoseconds."""
    return rospy.Time(*divmod(stamp_ns, 1_000_000_000))


def header(stamp_ns: int, frame: str) -> Header:
    """Return a header."""
    return Header(stamp=ros_time(stamp_ns), frame_id=frame)


def quaternion(yaw_rad: float) -> Quaternion:
    """Return a turn about z."""
    return Quaternion(z=math.sin(yaw_rad / 2.0), w=math.cos(yaw_rad / 2.0))


def odometry(pose: Pose, speed: tuple[float, float], stamp_ns: int, frame: str) -> Odometry:
    """Return a pose in ``frame`` and a speed (m/s, rad/s) in base_link."""
    message = Odometry(header=header(stamp_ns, frame), child_frame_id="base_link")
    message.pose.pose.position.x, message.pose.pose.position.y = pose[:2]
    message.pose.pose.orientation = quaternion(pose[2])
    message.twist.twist.linear.x, message.twist.twist.angular.z = speed
    return message


def transform(parent: str, child: str, pose: Pose, stamp_ns: int) -> TransformStamped:
    """Return T_parent_child."""
    message = TransformStamped(header=header(stamp_ns, parent), child_frame_id=child)
    message.transform.translation.x, message.transform.translation.y = pose[:2]
    message.transform.rotation = quaternion(pose[2])
    return message


def scan(sweep: Sweep, stamp_ns: int) -> LaserScan:
    """Return a sweep that was measured at one moment."""
    return LaserScan(
        header=header(stamp_ns, "laser"),
        angle_min=sweep.angle_min_rad,
        angle_max=sweep.angle_min_rad + sweep.angle_step_rad * (len(sweep.ranges_m) - 1),
        angle_increment=sweep.angle_step_rad,
        scan_time=0.1,
        range_min=sweep.range_min_m,
        range_max=sweep.range_max_m,
        ranges=sweep.ranges_m.tolist(),
    )


def battery(state: Battery, stamp_ns: int) -> BatteryState:
    """Return how full the battery is; ``percentage`` from 0 to 1, as sensor_msgs has it."""
    charging = BatteryState.POWER_SUPPLY_STATUS_CHARGING if state.charging else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    message = BatteryState(header=header(stamp_ns, ""), voltage=state.volts, percentage=state.percent / 100.0, present=True)
    message.current = message.charge = message.capacity = message.design_capacity = math.nan  # not measured
    message.power_supply_status = charging
    return message
