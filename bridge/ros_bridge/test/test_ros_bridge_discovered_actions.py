"""`./alula bridge --all` as a process: action servers of both worlds are found, serve clients of the other world, and go."""

from xmlrpc.client import ServerProxy

from action_msgs.msg import GoalStatus
from ros_bridge_action_nodes import WITHIN_S, Sent, feedback_arrives
from ros_bridge_harness import Ros1Peer, wait_until

CONFIG = "discover: {all: true}"


def test_an_actionlib_server_is_found_and_its_action_goes_with_it(master, action_ros2):
    server = Ros1Peer(master, "ros_bridge_action_peer.py")
    server.do("serve", name="/da/in_ros1")
    client = action_ros2.client("/da/in_ros1")
    wait_until(lambda: feedback_arrives(client), "the bridge knows the client's reader of feedback", WITHIN_S)
    sent = Sent(client, target=3, period_s=0.02, behaviour="held")
    wait_until(lambda: len(sent.feedback) == 3, "all feedback arrives", WITHIN_S)
    server.do("finish")
    answer = sent.result()
    assert (answer.status, list(answer.result.counted), answer.result.message) == (GoalStatus.STATUS_SUCCEEDED, [1, 2, 3], "from ROS 1")
    assert [(feedback.count, feedback.fraction) for feedback in sent.feedback] == [(number, number / 3) for number in range(1, 4)]
    server.do("leave")
    wait_until(lambda: not client.server_is_ready(), "the action goes from ROS 2", WITHIN_S)


def test_a_ros2_action_server_is_found_and_its_action_goes_with_it(master, action_ros1, action_ros2):
    server = action_ros2.server("/da/in_ros2")
    action_ros1.do("client", name="/da/in_ros2")
    assert action_ros1.expect("connected", within_s=WITHIN_S)["found"]
    action_ros1.do("goal", name="/da/in_ros2", key="found", target=3, period_s=0.05, behaviour="held")
    for number in range(1, 4):
        assert action_ros1.expect("feedback", key="found", count=number, within_s=WITHIN_S)["fraction"] == number / 3
    server.finish.set()
    end = action_ros1.expect("transition", key="found", state="DONE", within_s=WITHIN_S)
    assert (end["terminal"], end["counted"], end["message"]) == ("SUCCEEDED", [1, 2, 3], "from ROS 2")
    assert "/da/in_ros2/status" in published(master)
    action_ros2.tidy()
    wait_until(lambda: "/da/in_ros2/status" not in published(master), "the action goes from ROS 1", WITHIN_S)


def published(master):
    return {topic for topic, _ in ServerProxy(master.uri).getSystemState("/bridge_test")[2][0]}
