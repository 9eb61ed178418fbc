"""The whole functional layer as roslaunch starts it, driven by stock actionlib clients on simulated time."""

from __future__ import annotations

import json
import math
from pathlib import Path

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from alula_testing.waits import until
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import OccupancyGrid, Odometry
from std_msgs.msg import String
from std_srvs.srv import SetBool

WORLD = Path(__file__).parents[4] / "worlds/office.yaml"
LAUNCH = Path(__file__).parents[1] / "launch/functional.launch"
UP_S, DRIVE_S = 120.0, 240.0  # wall clock


class Layer:
    """The functional layer, and what a test sees of it."""

    def __init__(self):
        self.truth, self.state, self.feedback = None, {}, []
        self._clients = {}
        self._subscribers = [
            rospy.Subscriber("/truth/odom", Odometry, lambda message: setattr(self, "truth", message)),
            rospy.Subscriber("/truth/state", String, lambda message: setattr(self, "state", json.loads(message.data))),
        ]

    def client(self, name):
        if name not in self._clients:
            self._clients[name] = actionlib.SimpleActionClient(name, MoveBaseAction)
            until(lambda: self._clients[name].wait_for_server(rospy.Duration.from_sec(0.1)), what=f"a server {name}")
        return self._clients[name]

    def send(self, name, x=0.0, y=0.0, yaw=0.0):
        goal = MoveBaseGoal()
        goal.target_pose.header.frame_id = "map"
        place = goal.target_pose.pose
        place.position.x, place.position.y = x, y
        place.orientation.z, place.orientation.w = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
        client = self.client(name)
        client.send_goal(goal, feedback_cb=self.feedback.append)
        return client

    def drive(self, name, *pose):
        client = self.send(name, *pose)
        until(lambda: client.get_state() not in {GoalStatus.PENDING, GoalStatus.ACTIVE}, timeout_s=DRIVE_S, what=f"{name} ends")
        return client.get_state(), client.get_goal_status_text()

    def distance_m(self, x, y):
        position = self.truth.pose.pose.position
        return math.hypot(position.x - x, position.y - y)


@pytest.fixture
def start_layer(ros_master, start_node):
    rospy.set_param("/use_sim_time", True)

    def start(*arguments):
        start_node(["roslaunch", str(LAUNCH), f"world:={WORLD}", "rate:=0", *arguments])
        layer = Layer()
        until(lambda: layer.truth is not None and layer.state.get("t_s", 0.0) > 0.5, what="simulated time begins")
        return layer

    return start


def test_stock_clients_drive_it_through_doors_and_onto_the_dock(start_layer):
    layer = start_layer("faults:=door:store")
    grid = rospy.wait_for_message("/map", OccupancyGrid, timeout=UP_S)
    assert (grid.info.width, grid.info.height) == (328, 224)

    # The newest goal counts, also of another action; a goal that is cancelled stops the rover.
    first = layer.send("move_base", 14.5, 5.4, math.pi)
    until(lambda: layer.distance_m(0.57, 5.4) > 1.0, timeout_s=DRIVE_S, what="a metre driven")
    client = layer.send("follow_corridor", 14.5, 5.4, math.pi)
    until(lambda: first.get_state() == GoalStatus.PREEMPTED, timeout_s=DRIVE_S, what="preempted by another goal")
    assert first.get_goal_status_text() == "another goal has come"
    assert client.get_state() in {GoalStatus.PENDING, GoalStatus.ACTIVE}
    client.cancel_goal()
    until(lambda: client.get_state() == GoalStatus.PREEMPTED, timeout_s=DRIVE_S, what="preempted")
    from_m = layer.distance_m(0.57, 5.4)
    second_s = rospy.get_time() + 1.0
    until(lambda: rospy.get_time() > second_s, timeout_s=DRIVE_S, what="a second")
    assert layer.distance_m(0.57, 5.4) - from_m < 0.3
    assert layer.feedback

    # Two goals behind doors: one is opened, one stays shut.
    assert rospy.ServiceProxy("/door/kitchen/open", SetBool)(True).success
    assert layer.drive("move_base", 2.6, 8.6, math.pi) == (GoalStatus.SUCCEEDED, "arrived")
    assert layer.distance_m(2.6, 8.6) < 0.25
    assert not rospy.ServiceProxy("/door/store/open", SetBool)(True).success
    status, text = layer.drive("move_base", 2.0, 1.6, math.pi)
    assert status == GoalStatus.ABORTED
    assert "no way" in text or "stays in the way" in text

    assert layer.drive("dock") == (GoalStatus.SUCCEEDED, "charging")
    until(lambda: layer.state["charging"], what="the truth says so, too")
    assert layer.state["collisions"] == 0


def test_carried_away_it_notices_and_finds_itself_by_turning(start_layer):
    layer = start_layer("faults:=pose:lost@3")
    health = []
    rospy.Subscriber("/health", String, lambda message: health.append(json.loads(message.data)))
    client = layer.send("move_base", 14.5, 5.4, math.pi)
    until(lambda: health and health[-1]["pose"] == "LOST", timeout_s=DRIVE_S, what="LOST")
    client.cancel_goal()

    # A search that is stopped leaves the rover standing; the next one finds it.
    turning = lambda: abs(layer.truth.twist.twist.angular.z) > 0.3
    stopped = layer.send("localize")
    until(turning, timeout_s=DRIVE_S, what="it turns")
    stopped.cancel_goal()
    until(lambda: stopped.get_state() == GoalStatus.PREEMPTED and not turning(), timeout_s=DRIVE_S, what="it stands")
    status, told = layer.drive("localize")
    assert status == GoalStatus.SUCCEEDED, told
    until(lambda: health[-1]["pose"] == "GOOD", what="GOOD")
    assert rospy.ServiceProxy("/door/office/open", SetBool)(True).success
    assert layer.drive("move_base", 13.4, 8.8, 0.0) == (GoalStatus.SUCCEEDED, "arrived")
    assert layer.distance_m(13.4, 8.8) < 0.25
    assert layer.state["collisions"] == 0
