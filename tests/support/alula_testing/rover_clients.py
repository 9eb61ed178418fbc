"""Stock clients of the rover, a process each: `ros1` of its navigation, by actionlib; `ros2` of its skills, by rclpy.

Prints what it saw as JSON.
"""

from __future__ import annotations

import json
import sys
from typing import Any

WAIT_S = 120.0
"""Wall clock: for a server, and for what it was asked to do."""


def navigation() -> dict[str, Any]:
    """Have /move_base drive somewhere."""
    import actionlib
    import rospy
    from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal

    rospy.init_node("stock_client")
    client = actionlib.SimpleActionClient("/move_base", MoveBaseAction)
    assert client.wait_for_server(rospy.Duration.from_sec(10.0 * WAIT_S))  # of simulated time
    goal, heard = MoveBaseGoal(), []
    goal.target_pose.header.frame_id = "map"
    goal.target_pose.pose.position.x, goal.target_pose.pose.position.y, goal.target_pose.pose.orientation.w = 3.0, 5.4, 1.0
    client.send_goal(goal, feedback_cb=heard.append)
    assert client.wait_for_result(rospy.Duration.from_sec(10.0 * WAIT_S))
    return {"state": client.get_state(), "text": client.get_goal_status_text(), "heard": len(heard)}


def skills() -> dict[str, Any]:
    """Drive somewhere by a skill, and stop a search for the pose."""
    import rclpy
    from base_interfaces.action import DriveTo, Localise
    from rclpy.action import ActionClient  # noqa: TID251 - a stock client, as others have it
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from skillset_interfaces.msg import Heartbeat, ResourceStates

    rclpy.init()
    node = rclpy.create_node("stock_client")

    def awaited(future: Any) -> Any:
        rclpy.spin_until_future_complete(node, future, timeout_sec=WAIT_S)
        return future.result()

    def send(kind: Any, name: str, goal: Any, heard: list[Any]) -> Any:
        client = ActionClient(node, kind, f"/base/skill/{name}")
        assert client.wait_for_server(timeout_sec=WAIT_S)
        return awaited(client.send_goal_async(goal, feedback_callback=heard.append))

    known: list[bool] = []  # whether it knows where it is, and its dead man hears the managers
    needed = {("pose_status", "GOOD"), ("link", "UP")}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    look = lambda told: known.append(needed <= {(one.name, one.state) for one in told.resources})  # noqa: E731
    node.create_subscription(ResourceStates, "/base/resource_states", look, latched)
    alive: list[Any] = []  # managers say so once they take requests
    node.create_subscription(Heartbeat, "/base/alive", alive.append, latched)
    while not alive or not known or not known[-1]:
        rclpy.spin_once(node, timeout_sec=0.1)

    heard: list[Any] = []
    goal = DriveTo.Goal()
    goal.target.x, goal.target.y = 1.5, 5.4
    driven = awaited(send(DriveTo, "drive_to", goal, heard).get_result_async()).result
    searched: list[Any] = []
    handle = send(Localise, "localise", Localise.Goal(), searched)
    while not searched:
        rclpy.spin_once(node, timeout_sec=0.1)
    awaited(handle.cancel_goal_async())
    stopped = awaited(handle.get_result_async()).result
    return {"driven": [driven.outcome, driven.result, driven.message], "heard": len(heard), "stopped": stopped.outcome}


if __name__ == "__main__":
    print(json.dumps({"ros1": navigation, "ros2": skills}[sys.argv[1]]()))  # noqa: T201
