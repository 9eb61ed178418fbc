"""Services through the bridge as a process, between a ROS master with a rospy peer and a DDS domain with this process as rclpy peer."""

import threading

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from ros_bridge_harness import Ros1Peer
from ros_bridge_nodes import wait_ros1_receives
from std_msgs.msg import String
from std_srvs.srv import Empty, SetBool

CONFIG = """
topics:
  - {name: /bt/down, direction: ros2_to_ros1, type: std_msgs/String, depth: 200}
services:
  - {name: /bt/in_ros1, server: ros1, type: std_srvs/SetBool, timeout_s: 4.0}
  - {name: /bt/in_ros1_hasty, server: ros1, type: std_srvs/SetBool, timeout_s: 0.5}
  - {name: /bt/held, server: ros1, type: std_srvs/SetBool, timeout_s: 60.0}
  - {name: /bt/in_ros1_plain, server: ros1, type: std_srvs/Empty, timeout_s: 0.5}
  - {name: /bt/in_ros2, server: ros2, type: std_srvs/SetBool, timeout_s: 4.0}
  - {name: /bt/in_ros2_hasty, server: ros2, type: std_srvs/SetBool, timeout_s: 0.5}
"""


def test_ros2_client_calls_a_ros1_server_until_it_goes_and_its_successor_comes(ros2, master):
    for _ in range(2):
        server = Ros1Peer(master)
        server.do("serve", service="/bt/in_ros1", type="std_srvs/SetBool", behaviour="echo")
        for data in (True, False, True):
            response = ros2.call("/bt/in_ros1", SetBool, SetBool.Request(data=data))
            assert (response.success, response.message) == (data, "from ROS 1")
            assert server.expect("request")["hex"] == ("01" if data else "00")
        server.close()


def test_ros2_client_gets_a_refusal_when_there_is_no_ros1_server(ros2, bridge):
    response = ros2.call("/bt/in_ros1_hasty", SetBool, SetBool.Request(data=True))
    assert response.success is False
    assert "no server" in response.message


def test_response_without_a_flag_is_not_sent_at_all(ros2, bridge):
    response = ros2.call("/bt/in_ros1_plain", Empty, Empty.Request(), within_s=1.5)
    assert response is None


@pytest.mark.parametrize(("behaviour", "reason"), [("raise", "the handler is broken"), ("die", "ended in the call"), ("slow", "timed out")])
def test_ros2_client_gets_a_refusal_when_the_ros1_server_fails(ros2, master, behaviour, reason):
    service = "/bt/in_ros1_hasty" if behaviour == "slow" else "/bt/in_ros1"
    server = Ros1Peer(master)
    server.do("serve", service=service, type="std_srvs/SetBool", behaviour=behaviour, seconds=3.0)
    replies: list = []
    caller = threading.Thread(target=lambda: replies.append(ros2.call(service, SetBool, SetBool.Request(data=True))))
    caller.start()
    server.expect("request")
    caller.join()
    (response,) = replies
    assert response.success is False
    assert reason in response.message
    server.close()


def test_ros1_client_calls_a_ros2_server(ros1, ros2):
    def handle(request, response):
        response.success = not request.data
        response.message = "from ROS 2"
        return response

    ros2.serve("/bt/in_ros2", handle)
    ros1.do("call", service="/bt/in_ros2", type="std_srvs/SetBool", values={"data": False})
    assert ros1.expect("called", "call_failed")["text"] == 'success: True\nmessage: "from ROS 2"'


def test_ros1_client_gets_an_error_when_there_is_no_ros2_server(ros1):
    ros1.do("call", service="/bt/in_ros2_hasty", type="std_srvs/SetBool", values={"data": True})
    assert "no server for /bt/in_ros2_hasty in ROS 2" in ros1.expect("called", "call_failed")["reason"]


def test_ros1_client_gets_an_error_when_the_ros2_server_raises_or_goes(ros1, ros2):
    taken = threading.Event()
    gone = threading.Event()
    server_node = rclpy.create_node("bridge_test_server")

    def handle(_request, _response):
        taken.set()
        gone.wait(5.0)
        raise ValueError("broken")

    server_node.create_service(SetBool, "/bt/in_ros2", handle)
    executor = SingleThreadedExecutor()
    executor.add_node(server_node)

    def spin():
        try:
            executor.spin()
        except ValueError:
            server_node.destroy_node()

    thread = threading.Thread(target=spin)
    thread.start()
    ros1.do("call", service="/bt/in_ros2", type="std_srvs/SetBool", values={"data": True})
    assert taken.wait(5.0)
    gone.set()
    assert "ended in the call" in ros1.expect("called", "call_failed")["reason"]
    thread.join()
    executor.shutdown()


def test_slow_services_stall_no_topic(ros1, ros2, master):
    """While two calls are under way, each message of a topic arrives before the next one is sent."""
    slow = Ros1Peer(master)
    slow.do("serve", service="/bt/held", type="std_srvs/SetBool", behaviour="held")
    slow.do("subscribe", topic="/bt/down", type="std_msgs/String")
    publisher = ros2.publisher("/bt/down", String, 200)
    wait_ros1_receives(slow, publisher, "/bt/down")
    replies: list = []
    callers = [threading.Thread(target=lambda: replies.append(ros2.call("/bt/held", SetBool, SetBool.Request()))) for _ in range(2)]
    for caller in callers:
        caller.start()
    slow.expect("request")
    slow.expect("request")
    for number in range(50):
        publisher.publish(String(data=f"{number:03}"))
        event = slow.expect("message", topic="/bt/down")
        assert bytes.fromhex(event["hex"])[4:] == f"{number:03}".encode()
    assert replies == []  # so all of it happened while the calls were under way
    slow.do("let_go")
    for caller in callers:
        caller.join()
    assert [response.message for response in replies] == ["from ROS 1"] * 2
    slow.close()
