"""`./alula bridge --all` as a process: what appears in either world crosses, under its name or another, and nothing comes back."""

import struct

import rclpy
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_bridge_harness import Ros1Peer
from ros_bridge_nodes import LATCHED, hex_of, paced, text_of
from std_msgs.msg import Float64, Int32, String
from std_srvs.srv import Trigger
from uav_msgs.msg import GuidanceState

CONFIG = """
discover:
  all: true
  exclude: [/secret*]
  rename: {/old: /new, /rooms/one: /one}
types:
  messages:
    - {ros1: std_msgs/Float32, ros2: std_msgs/Float64, fields: {data: data}}
"""


def test_the_only_message_of_a_short_lived_ros1_publisher_arrives_once(master, ros2_node):
    received = ros2_node.subscribe("/d/once_up", String)
    for text in ("alone", "after it"):
        peer = Ros1Peer(master)
        peer.do("publish_once", topic="/d/once_up", type="std_msgs/String", values={"data": text})
        ros2_node.until(lambda text=text: received and received[-1].data == text, f"'{text}' arrives")
        peer.process.wait(5.0)
    assert [message.data for message in received] == ["alone", "after it"]


def test_the_only_message_of_a_short_lived_ros2_publisher_arrives_once(ros1, ros2_node):
    ros1.do("subscribe", topic="/d/once_down", type="std_msgs/String")
    for text in ("alone", "after it"):
        publisher = ros2_node.publisher("/d/once_down", String)
        ros2_node.until(lambda publisher=publisher: publisher.get_subscription_count() > 0, "the bridge subscribes")
        publisher.publish(String(data=text))
        publisher.wait_for_all_acked()
        ros2_node.node.destroy_publisher(publisher)
        assert text_of(ros1.expect("message", topic="/d/once_down")) == text


def test_a_publisher_that_restarts_is_picked_up_again(master, ros2_node):
    received = ros2_node.subscribe("/d/restart", String)
    for text in ("first", "second"):
        peer = Ros1Peer(master)
        peer.do("publish_once", topic="/d/restart", type="std_msgs/String", values={"data": text})
        ros2_node.until(lambda text=text: received and received[-1].data == text, f"{text} arrives")
        peer.process.wait(5.0)


def open_both_ways(ros1, ros2_node, publisher, topic, received):
    """Publish on both sides until each side has a message of the other, and wait for the last of these."""

    @paced
    def probe():
        ros1.do("publish", topic=topic, values={"data": "open one"})
        publisher.publish(publisher.msg_type(data="open two"))

    def opened():
        probe()
        # Each side hears itself, too.
        down = any("/ros_bridge" in line and b"open two".hex() in line for line in ros1.lines)
        return down and any(message.data == "open one" for message in received)

    ros1.lines.clear()
    ros2_node.until(opened, f"{topic} is open both ways")
    round_trip(ros1, ros2_node, publisher, topic, received, "opened")


def round_trip(ros1, ros2_node, publisher, topic, received, word):
    """Send a marker to ROS 1, and when it has arrived another one to ROS 2; return what ROS 1 got meanwhile, as hex.

    Routes keep the order: what was sent before has arrived with the markers, and its echoes with those of a second round trip.
    """
    field = "data" if publisher.msg_type is String else "msg"
    seen = []

    def see(text):
        while not seen or text.encode().hex() not in seen[-1]:
            seen.append(ros1.expect("message", topic=topic)["hex"])

    publisher.publish(publisher.msg_type(**{field: f"{word} two"}))
    see(f"{word} two")
    ros1.do("publish", topic=topic, values={field: f"{word} one"})
    see(f"{word} one")  # a peer hears itself
    markers = {f"{word} one", f"{word} two"}
    ros2_node.until(lambda: markers <= {getattr(message, field) for message in received}, f"'{word}' arrives in ROS 2")
    return seen


def test_publishers_in_both_worlds_hear_each_other_and_no_echo(ros1, ros2_node):
    ros1.do("subscribe_raw", topic="/d/both")
    received = ros2_node.subscribe("/d/both", String, QoSProfile(depth=200))
    publisher = ros2_node.publisher("/d/both", String)
    ros1.do("advertise", topic="/d/both", type="std_msgs/String")
    open_both_ways(ros1, ros2_node, publisher, "/d/both", received)
    received.clear()
    for number in range(20):
        publisher.publish(String(data=f"two {number}"))
        ros1.do("publish", topic="/d/both", values={"data": f"one {number}"})
    in_ros1 = [hex_bytes for word in ("end", "echo") for hex_bytes in round_trip(ros1, ros2_node, publisher, "/d/both", received, word)]
    wanted = [f"{what} {world}" for world in ("one", "two") for what in ("end", "echo")]
    wanted += [f"{world} {number}" for world in ("one", "two") for number in range(20)]
    assert sorted(message.data for message in received) == sorted(wanted)
    assert sorted(in_ros1) == sorted(map(hex_of, wanted))


def test_a_mapped_type_crosses_both_ways_without_an_echo(ros1, ros2_node):
    ros1.do("subscribe", topic="/d/log", type="rosgraph_msgs/Log")
    ros1.do("advertise", topic="/d/log", type="rosgraph_msgs/Log")
    received = ros2_node.subscribe("/d/log", Log, QoSProfile(depth=200))
    publisher = ros2_node.publisher("/d/log", Log)

    @paced
    def probe():
        ros1.do("publish", topic="/d/log", values={"level": 4, "msg": "from one", "topics": ["/lost"]})
        publisher.publish(Log(level=Log.WARN, msg="from two"))

    def arrive():
        probe()
        # A peer hears itself, too, as soon as rospy has connected it to itself.
        heard = all(any(text.hex() in line for line in ros1.lines) for text in (b"from one", b"from two"))
        return heard and {message.msg for message in received} == {"from one", "from two"}

    ros2_node.until(arrive, "it arrives in both worlds")
    assert {message.level for message in received if message.msg == "from one"} == {4}
    round_trip(ros1, ros2_node, publisher, "/d/log", received, "opened")
    ros1.do("publish", topic="/d/log", values={"msg": "last one"})
    in_ros1 = [hex_bytes for word in ("end", "echo") for hex_bytes in round_trip(ros1, ros2_node, publisher, "/d/log", received, word)]
    assert sum(message.msg == "last one" for message in received) == 1
    assert sum(b"last one".hex() in hex_bytes for hex_bytes in in_ros1) == 1
    ones = sum(message.msg == "from one" for message in received)
    assert ones <= sum('"published"' in line and "/d/log" in line for line in ros1.lines)


def test_a_custom_type_crosses_without_being_compiled_into_the_bridge(ros1, ros2_node):
    received = ros2_node.subscribe("/d/state", GuidanceState)
    ros1.do("advertise", topic="/d/state", type="uav_msgs/GuidanceState", latch=True)
    ros1.do("publish", topic="/d/state", values={"mode": "GUIDED", "obstacle_m": 2.5})
    ros2_node.until(lambda: received, "it arrives")
    assert (received[0].mode, received[0].obstacle_m) == ("GUIDED", 2.5)


def test_a_subscriber_of_any_type_gets_the_type_from_the_other_world(ros1, ros2_node):
    """The configuration maps ROS 2's Float64 to ROS 1's Float32."""
    for topic, message, ros1_bytes in [
        ("/d/any", Int32(data=7), struct.pack("<i", 7)),
        ("/d/any_f", Float64(data=2.5), struct.pack("<f", 2.5)),
    ]:
        ros1.do("subscribe_raw", topic=topic)
        publisher = ros2_node.publisher(topic, type(message))
        ros2_node.until(lambda publisher=publisher: publisher.get_subscription_count() > 0, "the bridge subscribes")
        publisher.publish(message)
        assert ros1.expect("message", topic=topic)["hex"] == ros1_bytes.hex()


def test_renamed_topics_and_excluded_ones(ros1, ros2_node):
    renamed, below, secret = (ros2_node.subscribe(name, String, LATCHED) for name in ("/new", "/one/door", "/secret"))
    for topic in ("/secret", "/old", "/rooms/one/door"):
        ros1.do("advertise", topic=topic, type="std_msgs/String", latch=True)
        ros1.do("publish", topic=topic, values={"data": topic})
    ros2_node.until(lambda: renamed and below, "the renamed ones arrive")
    assert (renamed[0].data, below[0].data, secret) == ("/old", "/rooms/one/door", [])
    assert "/secret" not in {name for name, _ in ros2_node.node.get_topic_names_and_types() if ros2_node.node.count_publishers(name)}


def test_ros1_parameters_are_parameters_of_a_ros2_node(ros1, ros2_node):
    for name, value in {"/cam/rate": 2.5, "/cam/names": ["a", "b"], "/use_sim_time": True}.items():
        ros1.do("set_parameter", name=name, value=value)

    def shown(*names):
        answer = ros2_node.call("/ros1_parameters/get_parameters", GetParameters, GetParameters.Request(names=names))
        return [rclpy.parameter.parameter_value_to_python(value) for value in answer.values]

    names = ("cam.rate", "cam.names", "use_sim_time")
    ros2_node.until(lambda: shown(*names) == [2.5, ["a", "b"], True], "the parameters are there")
    ros1.do("set_parameter", name="/cam/rate", value="fast")
    ros2_node.until(lambda: shown("cam.rate") == ["fast"], "a change of value and kind is there")
    wish = Parameter("cam.rate", value=1).to_parameter_msg()
    answer = ros2_node.call("/ros1_parameters/set_parameters", SetParameters, SetParameters.Request(parameters=[wish]))
    assert "set them there" in answer.results[0].reason
    assert shown("cam.rate") == ["fast"]


def test_services_of_both_worlds_are_found(ros1, ros2_node):
    def answer(_request, response):
        response.success, response.message = True, "from ROS 2"
        return response

    ros2_node.node.create_service(Trigger, "/d/ask_two", answer)
    ros1.do("call", service="/d/ask_two", type="std_srvs/Trigger", values={})
    seen = len(ros1.lines)
    ros2_node.until(lambda: any('"called"' in line for line in ros1.lines[seen:]) or '"called"' in ros1.lines[-1], "the call is answered")
    assert "from ROS 2" in ros1.expect("called")["text"]
