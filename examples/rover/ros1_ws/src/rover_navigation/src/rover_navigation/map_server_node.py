"""Publishes the map, latched, as ROS 1's map_server does."""

from __future__ import annotations

import rospy
import yaml
from nav_msgs.msg import OccupancyGrid

from rover_navigation.grid_map import MapError, load_map
from rover_navigation.ros import grid_message, world_file


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("map_server")
    try:
        world = world_file()
        grid = load_map(world.with_name(yaml.safe_load(world.read_text(encoding="utf-8"))["map"]))
    except (OSError, KeyError, MapError) as error:
        rospy.logfatal(f"no map: {error}")
        raise SystemExit(2) from error
    publisher = rospy.Publisher("/map", OccupancyGrid, queue_size=1, latch=True)
    publisher.publish(grid_message(grid, rospy.Time()))
    rospy.spin()
