"""A ROS 2 node in a process of its own, which a test may stop: `python ros_bridge_counting_peer.py TOPIC DEPTH`.

It prints the text and the writer's number of each message, as JSON lines.
"""

import json
import sys

import rclpy
from std_msgs.msg import String


def main() -> None:
    topic, depth = sys.argv[1], int(sys.argv[2])
    rclpy.init(args=[])
    node = rclpy.create_node("counting_peer")

    def take(message: String, info: dict) -> None:
        sys.stdout.write(json.dumps([message.data, info["publication_sequence_number"]]) + "\n")
        sys.stdout.flush()

    node.create_subscription(String, topic, take, depth)
    rclpy.spin(node)


main()
