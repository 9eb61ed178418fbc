"""Between ROS messages and poses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import rospy
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from rover_navigation.geometry import Points, Pose, points_of
from rover_navigation.grid_map import GridMap
from rover_navigation.planning import RADIUS_M

WAIT_FOR_MAP_S = 60.0


def pose_of(message: PoseMessage) -> Pose:
    """Return a pose in the plane."""
    q = message.orientation
    return message.position.x, message.position.y, 2.0 * math.atan2(q.z, q.w)


def pose_message(pose: Pose) -> PoseMessage:
    """Return a pose."""
    message = PoseMessage()
    message.position.x, message.position.y = pose[:2]
    message.orientation.z, message.orientation.w = math.sin(pose[2] / 2.0), math.cos(pose[2] / 2.0)
    return message


def transform(stamp: rospy.Time, parent: str, child: str, pose: Pose) -> TransformStamped:
    """Return T_parent_child."""
    message = TransformStamped(header=Header(stamp=stamp, frame_id=parent), child_frame_id=child)
    place = pose_message(pose)
    message.transform.translation.x, message.transform.translation.y = pose[:2]
    message.transform.rotation = place.orientation
    return message


def points_of_scan(scan: LaserScan) -> Points:
    """Return what a scan hit, in base_link: the laser is in its middle, so what is nearer than its rim is itself."""
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    ranges[(ranges < max(scan.range_min, RADIUS_M)) | (ranges > scan.range_max)] = np.inf
    return points_of(ranges, scan.angle_min, scan.angle_increment)


def free_of_scan(scan: LaserScan) -> Points:
    """Return how far the beams came that hit nothing, in base_link."""
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    return points_of(np.where(np.isinf(ranges), scan.range_max, np.inf), scan.angle_min, scan.angle_increment)


def grid_message(grid: GridMap, stamp: rospy.Time) -> OccupancyGrid:
    """Return a map; 100 is occupied, 0 is free."""
    rows, columns = grid.occupied.shape
    info = MapMetaData(resolution=grid.resolution_m, width=columns, height=rows)
    info.origin.position.x, info.origin.position.y = grid.origin_m
    info.origin.orientation.w = 1.0
    data = np.where(grid.occupied, 100, 0).astype(np.int8).ravel().tolist()
    return OccupancyGrid(header=Header(stamp=stamp, frame_id="map"), info=info, data=data)


def wait_for_map() -> GridMap:
    """Return the map of the topic /map; raises rospy.ROSException when none comes."""
    message = rospy.wait_for_message("/map", OccupancyGrid, timeout=None if rospy.get_param("/use_sim_time", False) else WAIT_FOR_MAP_S)
    info = message.info
    occupied = np.asarray(message.data, dtype=np.int8).reshape(info.height, info.width) > 65
    return GridMap(occupied, info.resolution, (info.origin.position.x, info.origin.position.y))


def world_file() -> Path:
    """Return the file that the parameter ~world names."""
    return Path(rospy.get_param("~world"))
