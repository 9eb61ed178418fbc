"""`./alula bridge --all` as a process: late joiners get what was latched, reliable and careless ends are both served."""

from geometry_msgs.msg import TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_bridge_harness import Ros1Peer
from ros_bridge_nodes import BEST_EFFORT, LATCHED, RELIABLE, hex_of, paced, wait_ros1_receives
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from ros_bridge.conversion import Types, ament_prefixes

CONFIG = "discover: {all: true}"


def test_every_late_joiner_in_ros2_gets_the_latched_message(ros1, ros2_node):
    ros1.do("advertise", topic="/d/map", type="std_msgs/String", latch=True)
    ros1.do("publish", topic="/d/map", values={"data": "old"})
    ros1.do("publish", topic="/d/map", values={"data": "the map"})
    for _ in range(3):
        received = ros2_node.subscribe("/d/map", String, LATCHED)
        ros2_node.until(lambda received=received: received, "the latched message arrives")
        assert received[-1].data == "the map"


def test_every_late_joiner_in_ros1_gets_the_transient_local_message(ros1, ros2_node, master):
    ros2_node.publisher("/d/map_down", String, LATCHED).publish(String(data="kept"))
    later = Ros1Peer(master)
    for peer in (ros1, later):
        peer.do("subscribe", topic="/d/map_down", type="std_msgs/String")
        assert peer.expect("message", topic="/d/map_down", hex=hex_of("kept"))["latched"]


def static(child):
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = "base"
    return TFMessage(transforms=[transform])


def test_static_transforms_of_all_ros1_publishers_reach_late_joiners(ros1, ros2_node, master):
    peers = [ros1, Ros1Peer(master), Ros1Peer(master)]
    for number, peer in enumerate(peers):
        peer.do("advertise", topic="/d/up/tf_static", type="tf2_msgs/TFMessage", latch=True)
        values = {"transforms": [{"header": {"frame_id": "base"}, "child_frame_id": f"c{number}"}]}
        peer.do("publish", topic="/d/up/tf_static", values=values)
    for _ in range(2):
        received = ros2_node.subscribe("/d/up/tf_static", TFMessage, QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        ros2_node.until(lambda received=received: len({message.transforms[0].child_frame_id for message in received}) >= 3, "all arrive")
        assert {message.transforms[0].child_frame_id for message in received} == {"c0", "c1", "c2"}


def test_static_transforms_of_all_ros2_publishers_reach_late_joiners(ros1, ros2_node, master):
    for number in range(3):
        ros2_node.publisher("/d/down/tf_static", TFMessage, LATCHED).publish(static(f"c{number}"))
    wanted = {
        bytes(Types(ament_prefixes()).message("tf2_msgs/TFMessage").to_ros1(serialize_message(static(f"c{n}")))).hex() for n in range(3)
    }
    later = Ros1Peer(master)
    for peer in (ros1, later):
        peer.do("subscribe", topic="/d/down/tf_static", type="tf2_msgs/TFMessage")
        assert {peer.expect("message", topic="/d/down/tf_static")["hex"] for _ in range(3)} == wanted


def ends_of_bridge(infos):
    return [info.qos_profile for info in infos if info.node_name == "ros_bridge"]


def test_best_effort_and_reliable_ends_of_ros2_are_both_served(ros1, ros2_node):
    careless, careful = ros2_node.subscribe("/d/up", String, BEST_EFFORT), ros2_node.subscribe("/d/up", String, RELIABLE)
    ros1.do("advertise", topic="/d/up", type="std_msgs/String")

    probe = paced(lambda: ros1.do("publish", topic="/d/up", values={"data": "x"}))

    def arrive():
        probe()
        return careless and careful

    ros2_node.until(arrive, "both get it")

    def offered():
        return [end.reliability for end in ends_of_bridge(ros2_node.node.get_publishers_info_by_topic("/d/up"))]

    ros2_node.until(lambda: offered() == [ReliabilityPolicy.RELIABLE], "the bridge offers reliable")


def test_the_bridge_asks_for_reliable_until_a_publisher_offers_less(ros1, ros2_node):
    ros1.do("subscribe", topic="/d/mixed", type="std_msgs/String")
    careful = ros2_node.publisher("/d/mixed", String, RELIABLE)

    def asked():
        return [end.reliability for end in ends_of_bridge(ros2_node.node.get_subscriptions_info_by_topic("/d/mixed"))]

    ros2_node.until(lambda: asked() == [ReliabilityPolicy.RELIABLE], "the bridge asks for reliable")
    careless = ros2_node.publisher("/d/mixed", String, BEST_EFFORT)
    ros2_node.until(lambda: asked() == [ReliabilityPolicy.BEST_EFFORT], "the bridge asks for best effort")
    ros2_node.until(lambda: careful.get_subscription_count() and careless.get_subscription_count(), "both are matched")
    for publisher in (careful, careless):
        wait_ros1_receives(ros1, publisher, "/d/mixed")
