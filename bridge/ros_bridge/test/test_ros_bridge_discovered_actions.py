"""`./alula bridge --all` as a process: action servers of both worlds are found, serve clients of the other world, and go."""

from xmlrpc.client import ServerProxy

from action_msgs.msg import GoalStatus
from ros_bridge_action_nodes import Sent, done_soon, feedback_arrives
from ros_bridge_harness import Ros1Peer

from alula_testing.waits import until

CONFIG = "discover: {all: true}"


def test_an_actionlib_server_is_found_and_its_action_goes_with_it(master, action_ros2):
    server = Ros1Peer(master, "ros_bridge_action_peer.py")
    server.do("serve", name="/da/in_ros1")
    client = action_ros2.client("/da/in_ros1")
    until(lambda: feedback_arrives(client), "the bridge knows the client's reader of feedback")
    sent = Sent(client, target=3, period_s=0.02, behaviour="held")
    until(lambda: len(sent.feedback) == 3, "all feedback arrives")
    server.do("finish")
    answer = sent.result()
    assert (answer.status, list(answer.result.counted), answer.result.message) == (GoalStatus.STATUS_SUCCEEDED, [1, 2, 3], "from ROS 1")
    assert [(feedback.count, feedback.fraction) for feedback in sent.feedback] == [(number, number / 3) for number in range(1, 4)]
    server.do("leave")
    until(lambda: not client.server_is_ready(), "the action goes from ROS 2")


def test_a_ros2_action_server_is_found_and_its_action_goes_with_it(master, action_ros1, action_ros2):
    server = action_ros2.server("/da/in_ros2")
    action_ros1.do("client", name="/da/in_ros2")
    assert action_ros1.expect("connected")["found"]
    action_ros1.do("goal", name="/da/in_ros2", key="found", target=3, period_s=0.05, behaviour="held")
    for number in range(1, 4):
        assert action_ros1.expect("feedback", key="found", count=number)["fraction"] == number / 3
    server.finish.set()
    end = action_ros1.expect("transition", key="found", state="DONE")
    assert (end["terminal"], end["counted"], end["message"]) == ("SUCCEEDED", [1, 2, 3], "from ROS 2")
    assert "/da/in_ros2/status" in published(master)
    action_ros2.tidy()
    until(lambda: "/da/in_ros2/status" not in published(master), "the action goes from ROS 1")


def published(master):
    return {topic for topic, _ in ServerProxy(master.uri).getSystemState("/bridge_test")[2][0]}


def test_a_server_of_an_older_version_serves_clients_of_ros2(master, action_ros2):
    """No file here has its version: the goal's is known from the server's subscriber, the others from its publishers."""
    server = Ros1Peer(master, "ros_bridge_action_peer.py")
    server.do("serve_old", name="/da/old")
    client = action_ros2.client("/da/old")

    def accepted():
        sent = Sent(client, target=1)  # refused until the bridge has learned the version
        return done_soon(sent.future) and sent.future.result().accepted

    until(accepted, "a goal is accepted")
    until(lambda: feedback_arrives(client), "a goal comes back")
    sent = Sent(client, target=7)
    answer = sent.result()
    assert (answer.status, list(answer.result.counted), answer.result.message) == (GoalStatus.STATUS_SUCCEEDED, [7], "from old times")
    assert [(feedback.count, feedback.fraction) for feedback in sent.feedback] == [(7, 0.0)]
