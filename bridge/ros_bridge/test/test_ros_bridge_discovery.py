"""`./alula bridge --all` as a process between a real ROS master with rospy peers and a DDS domain with this process as rclpy peer."""

import json
import struct
import subprocess
import sys
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_bridge_harness import RUNNING, BridgeProcess, Master, Ros1Peer, bag_folder, wait_until
from rosbags.rosbag1 import Reader
from std_msgs.msg import Float64, Int32, String
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import GuidanceState

from alula_flight.claims import free_port
from ros_bridge.conversion import Types, ament_prefixes

CONFIG = """
discover:
  all: true
  exclude: [/secret*]
  rename: {/old: /new, /rooms/one: /one}
types:
  messages:
    - {ros1: std_msgs/Float32, ros2: std_msgs/Float64, fields: {data: data}}
"""
LATCHED = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=20)
OURS = "/ros_bridge"


class Ros2Node:
    """An rclpy node spun in this thread, whenever something is waited for."""

    def __init__(self, name: str) -> None:
        self.node = rclpy.create_node(name)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def until(self, condition, what, within_s=15.0):
        def spin_and_ask():
            self.executor.spin_once(timeout_sec=0.02)
            return condition()

        wait_until(spin_and_ask, what, within_s)

    def subscribe(self, topic, kind, qos=RELIABLE, **options):
        received: list = []
        self.node.create_subscription(kind, topic, received.append, qos, **options)
        return received

    def publisher(self, topic, kind, qos=RELIABLE):
        return self.node.create_publisher(kind, topic, qos)

    def call(self, service, kind, request):
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready, f"{service} is there")
        future = client.call_async(request)
        self.until(future.done, f"{service} answers")
        return future.result()

    def close(self):
        self.executor.shutdown(timeout_sec=2.0)
        self.node.destroy_node()


@pytest.fixture(scope="module")
def master():
    master = Master(free_port())
    master.start()
    yield master
    master.close()


@pytest.fixture(scope="module")
def bridge(master, ros2_domain, tmp_path_factory):
    process = BridgeProcess(master, tmp_path_factory.mktemp("discovery"), CONFIG)
    process.wait_running()
    yield process
    assert process.close() < 5.0


@pytest.fixture(scope="module")
def ros1(bridge, master):
    peer = Ros1Peer(master)
    yield peer
    peer.close()


@pytest.fixture
def ros2(bridge, ros1, request):
    node = Ros2Node(f"peer_{len(request.node.name)}_{time.monotonic_ns()}")
    yield node
    node.close()


@pytest.fixture(autouse=True)
def leave_nothing_running(ros1):
    before = list(RUNNING)
    yield
    for process in RUNNING:
        if process not in before:
            process.close()
    RUNNING[:] = before


def text_of(event):
    return bytes.fromhex(event["hex"])[4:].decode()


def hex_of(text):
    return (struct.pack("<I", len(text)) + text.encode()).hex()


def test_the_only_message_of_a_short_lived_ros1_publisher_arrives_once(master, ros2):
    received = ros2.subscribe("/d/once_up", String)
    peer = Ros1Peer(master)
    peer.do("publish_once", topic="/d/once_up", type="std_msgs/String", values={"data": "alone"})
    ros2.until(lambda: received, "it arrives")
    peer.process.wait(5.0)
    ros2.until(lambda: True, "nothing more")
    assert [message.data for message in received] == ["alone"]


def test_the_only_message_of_a_short_lived_ros2_publisher_arrives_once(ros1, ros2):
    ros1.do("subscribe", topic="/d/once_down", type="std_msgs/String")
    publisher = ros2.publisher("/d/once_down", String)
    ros2.until(lambda: publisher.get_subscription_count() > 0, "the bridge subscribes")
    publisher.publish(String(data="alone"))
    publisher.wait_for_all_acked()
    ros2.node.destroy_publisher(publisher)
    assert text_of(ros1.expect("message", topic="/d/once_down")) == "alone"


def test_a_publisher_that_restarts_is_picked_up_again(master, ros2):
    received = ros2.subscribe("/d/restart", String)
    for text in ("first", "second"):
        peer = Ros1Peer(master)
        peer.do("publish_once", topic="/d/restart", type="std_msgs/String", values={"data": text})
        ros2.until(lambda text=text: received and received[-1].data == text, f"{text} arrives")
        peer.process.wait(5.0)


def test_every_late_joiner_in_ros2_gets_the_latched_message(ros1, ros2):
    ros1.do("advertise", topic="/d/map", type="std_msgs/String", latch=True)
    ros1.do("publish", topic="/d/map", values={"data": "old"})
    ros1.do("publish", topic="/d/map", values={"data": "the map"})
    for _ in range(3):
        received = ros2.subscribe("/d/map", String, LATCHED)
        ros2.until(lambda received=received: received, "the latched message arrives")
        assert received[-1].data == "the map"


def test_every_late_joiner_in_ros1_gets_the_transient_local_message(ros1, ros2, master):
    ros2.publisher("/d/map_down", String, LATCHED).publish(String(data="kept"))
    later = Ros1Peer(master)
    for peer in (ros1, later):
        peer.do("subscribe", topic="/d/map_down", type="std_msgs/String")
        assert peer.expect("message", topic="/d/map_down", hex=hex_of("kept"))["latched"]


def static(child):
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = "base"
    return TFMessage(transforms=[transform])


def test_static_transforms_of_all_ros1_publishers_reach_late_joiners(ros1, ros2, master):
    peers = [ros1, Ros1Peer(master), Ros1Peer(master)]
    for number, peer in enumerate(peers):
        peer.do("advertise", topic="/d/up/tf_static", type="tf2_msgs/TFMessage", latch=True)
        values = {"transforms": [{"header": {"frame_id": "base"}, "child_frame_id": f"c{number}"}]}
        peer.do("publish", topic="/d/up/tf_static", values=values)
    for _ in range(2):
        received = ros2.subscribe("/d/up/tf_static", TFMessage, QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        ros2.until(lambda received=received: len({message.transforms[0].child_frame_id for message in received}) == 3, "all three arrive")


def test_static_transforms_of_all_ros2_publishers_reach_late_joiners(ros1, ros2, master):
    for number in range(3):
        ros2.publisher("/d/down/tf_static", TFMessage, LATCHED).publish(static(f"c{number}"))
    wanted = {
        bytes(Types(ament_prefixes()).message("tf2_msgs/TFMessage").to_ros1(serialize_message(static(f"c{n}")))).hex() for n in range(3)
    }
    later = Ros1Peer(master)
    for peer in (ros1, later):
        peer.do("subscribe", topic="/d/down/tf_static", type="tf2_msgs/TFMessage")
        assert {peer.expect("message", topic="/d/down/tf_static")["hex"] for _ in range(3)} == wanted


def ends_of_bridge(infos):
    return [info.qos_profile for info in infos if info.node_name == "ros_bridge"]


def test_best_effort_and_reliable_ends_of_ros2_are_both_served(ros1, ros2):
    careless, careful = ros2.subscribe("/d/up", String, BEST_EFFORT), ros2.subscribe("/d/up", String, RELIABLE)
    ros1.do("advertise", topic="/d/up", type="std_msgs/String")

    def arrive():
        ros1.do("publish", topic="/d/up", values={"data": "x"})
        return careless and careful

    ros2.until(arrive, "both get it")

    def offered():
        return [end.reliability for end in ends_of_bridge(ros2.node.get_publishers_info_by_topic("/d/up"))]

    ros2.until(lambda: offered() == [ReliabilityPolicy.RELIABLE], "the bridge offers reliable")


def test_the_bridge_asks_for_reliable_until_a_publisher_offers_less(ros1, ros2):
    ros1.do("subscribe", topic="/d/mixed", type="std_msgs/String")
    careful = ros2.publisher("/d/mixed", String, RELIABLE)

    def asked():
        return [end.reliability for end in ends_of_bridge(ros2.node.get_subscriptions_info_by_topic("/d/mixed"))]

    ros2.until(lambda: asked() == [ReliabilityPolicy.RELIABLE], "the bridge asks for reliable")
    careless = ros2.publisher("/d/mixed", String, BEST_EFFORT)
    ros2.until(lambda: asked() == [ReliabilityPolicy.BEST_EFFORT], "the bridge asks for best effort")
    ros2.until(lambda: careful.get_subscription_count() and careless.get_subscription_count(), "both are matched")
    for publisher, text in ((careful, "careful"), (careless, "careless")):
        deadline = time.monotonic() + 10.0
        while time.monotonic() < deadline:
            publisher.publish(String(data=text))
            if text_of(ros1.expect("message", topic="/d/mixed")) == text:
                break
        else:
            pytest.fail(f"nothing of {text} arrives")


def test_publishers_in_both_worlds_hear_each_other_and_no_echo(ros1, ros2):
    ros1.do("subscribe_raw", topic="/d/both")
    received = ros2.subscribe("/d/both", String, QoSProfile(depth=200))
    publisher = ros2.publisher("/d/both", String)
    ros1.do("advertise", topic="/d/both", type="std_msgs/String")
    open_both_ways(ros1, ros2, publisher, "/d/both", received)
    received.clear()
    for number in range(20):
        publisher.publish(String(data=f"two {number}"))
        ros1.do("publish", topic="/d/both", values={"data": f"one {number}"})
    publisher.publish(String(data="end"))
    ros1.do("publish", topic="/d/both", values={"data": "end"})
    wanted = sorted([f"{world} {number}" for number in range(20) for world in ("one", "two")] + ["end"] * 2)
    ros2.until(lambda: [message.data for message in received].count("end") == 2, "both ends arrive in ROS 2")
    in_ros1 = []
    while in_ros1.count("end") < 2:
        text = text_of(ros1.expect("message", topic="/d/both"))
        in_ros1 += [text] if text != "open" else []
    ros2.until(lambda: True, "an echo would come now")
    assert sorted(message.data for message in received if message.data != "open") == wanted
    assert sorted(in_ros1) == wanted


def open_both_ways(ros1, ros2, publisher, topic, received):
    """Publish on both sides until each side has a message of the other."""

    def opened():
        ros1.do("publish", topic=topic, values={"data": "open"})
        publisher.publish(publisher.msg_type(data="open"))
        return any("/ros_bridge" in line for line in ros1.lines) and len(received) > 2

    ros1.lines.clear()
    ros2.until(opened, f"{topic} is open both ways")
    time.sleep(0.3)  # what was sent to open it arrives
    ros2.until(lambda: True, "and is taken")


def test_a_mapped_type_crosses_both_ways_without_an_echo(ros1, ros2):
    ros1.do("subscribe", topic="/d/log", type="rosgraph_msgs/Log")
    ros1.do("advertise", topic="/d/log", type="rosgraph_msgs/Log")
    received = ros2.subscribe("/d/log", Log)
    publisher = ros2.publisher("/d/log", Log)

    def arrive():
        ros1.do("publish", topic="/d/log", values={"level": 4, "msg": "from one", "topics": ["/lost"]})
        publisher.publish(Log(level=Log.WARN, msg="from two"))
        returned = any(b"from two".hex() in line for line in ros1.lines)
        return returned and {message.msg for message in received} == {"from one", "from two"}

    ros2.until(arrive, "it arrives in both worlds")
    assert {message.level for message in received if message.msg == "from one"} == {4}
    ones = sum(message.msg == "from one" for message in received)
    ros1.do("publish", topic="/d/log", values={"msg": "last one"})
    ros2.until(lambda: received[-1].msg == "last one", "the last one arrives")
    time.sleep(0.2)
    ros2.until(lambda: True, "an echo would come now")
    assert sum(message.msg == "last one" for message in received) == 1
    assert ones <= sum('"published"' in line and "/d/log" in line for line in ros1.lines)


def test_a_custom_type_crosses_without_being_compiled_into_the_bridge(ros1, ros2):
    received = ros2.subscribe("/d/state", GuidanceState)
    ros1.do("advertise", topic="/d/state", type="uav_msgs/GuidanceState", latch=True)
    ros1.do("publish", topic="/d/state", values={"mode": "GUIDED", "obstacle_m": 2.5})
    ros2.until(lambda: received, "it arrives")
    assert (received[0].mode, received[0].obstacle_m) == ("GUIDED", 2.5)


def test_a_subscriber_of_any_type_gets_the_type_from_the_other_world(ros1, ros2):
    """The configuration maps ROS 2's Float64 to ROS 1's Float32."""
    for topic, message, ros1_bytes in [
        ("/d/any", Int32(data=7), struct.pack("<i", 7)),
        ("/d/any_f", Float64(data=2.5), struct.pack("<f", 2.5)),
    ]:
        ros1.do("subscribe_raw", topic=topic)
        publisher = ros2.publisher(topic, type(message))
        ros2.until(lambda publisher=publisher: publisher.get_subscription_count() > 0, "the bridge subscribes")
        publisher.publish(message)
        assert ros1.expect("message", topic=topic)["hex"] == ros1_bytes.hex()


def test_renamed_topics_and_excluded_ones(ros1, ros2):
    renamed, below, secret = (ros2.subscribe(name, String, LATCHED) for name in ("/new", "/one/door", "/secret"))
    for topic in ("/secret", "/old", "/rooms/one/door"):
        ros1.do("advertise", topic=topic, type="std_msgs/String", latch=True)
        ros1.do("publish", topic=topic, values={"data": topic})
    ros2.until(lambda: renamed and below, "the renamed ones arrive")
    assert (renamed[0].data, below[0].data, secret) == ("/old", "/rooms/one/door", [])
    assert "/secret" not in {name for name, _ in ros2.node.get_topic_names_and_types() if ros2.node.count_publishers(name)}


def test_a_type_that_can_not_cross_is_told_once_by_its_name(ros1, ros2, bridge):
    for topic in ("/d/none_1", "/d/none_2"):
        ros1.do("advertise", topic=topic, type="rosgraph_msgs/TopicStatistics")
    wait_until(lambda: any("rosgraph_msgs/TopicStatistics" in line for line in bridge.lines), "it is told")
    statuses = ros2.subscribe("/diagnostics", DiagnosticArray)
    ros2.until(lambda: statuses and any("/d/none_2" in status.name for status in statuses[-1].status), "the diagnostics name both")
    assert sum("rosgraph_msgs/TopicStatistics" in line for line in bridge.lines) == 1


def test_diagnostics_tell_every_route_in_both_worlds(ros1, ros2, bridge):
    statuses = ros2.subscribe("/diagnostics", DiagnosticArray)
    ros1.do("subscribe", topic="/diagnostics", type="diagnostic_msgs/DiagnosticArray")
    ros2.subscribe("/d/told", String)
    ros1.do("advertise", topic="/d/told", type="std_msgs/String", latch=True)
    ros1.do("publish", topic="/d/told", values={"data": "12345678"})

    def told():
        found = [status for array in statuses[-1:] for status in array.status if status.name == "ros_bridge: topic /d/told"]
        values = {item.key: item.value for item in found[0].values} if found else {}
        return values.get("count") == "1" and values["type"] == "std_msgs/String" and int(values["bytes"]) > 8

    ros2.until(told, "the count arrives")
    while b"ros_bridge: topic /d/told" not in bytes.fromhex(ros1.expect("message", topic="/diagnostics")["hex"]):
        pass
    wait_until(lambda: json.loads(bridge.stats_file.read_text())["topics"].get("/d/told", {}).get("count") == 1, "the file has it")


def test_ros1_parameters_are_parameters_of_a_ros2_node(ros1, ros2):
    for name, value in {"/cam/rate": 2.5, "/cam/names": ["a", "b"], "/use_sim_time": True}.items():
        ros1.do("set_parameter", name=name, value=value)

    def shown(*names):
        answer = ros2.call("/ros1_parameters/get_parameters", GetParameters, GetParameters.Request(names=names))
        return [rclpy.parameter.parameter_value_to_python(value) for value in answer.values]

    names = ("cam.rate", "cam.names", "use_sim_time")
    ros2.until(lambda: shown(*names) == [2.5, ["a", "b"], True], "the parameters are there")
    ros1.do("set_parameter", name="/cam/rate", value="fast")
    ros2.until(lambda: shown("cam.rate") == ["fast"], "a change of value and kind is there")
    wish = Parameter("cam.rate", value=1).to_parameter_msg()
    answer = ros2.call("/ros1_parameters/set_parameters", SetParameters, SetParameters.Request(parameters=[wish]))
    assert "set them there" in answer.results[0].reason
    assert shown("cam.rate") == ["fast"]


def test_services_of_both_worlds_are_found(ros1, ros2):
    def answer(_request, response):
        response.success, response.message = True, "from ROS 2"
        return response

    ros2.node.create_service(Trigger, "/d/ask_two", answer)
    ros1.do("call", service="/d/ask_two", type="std_srvs/Trigger", values={})
    seen = len(ros1.lines)
    ros2.until(lambda: any('"called"' in line for line in ros1.lines[seen:]) or '"called"' in ros1.lines[-1], "the call is answered")
    assert "from ROS 2" in ros1.expect("called")["text"]


def bridge_command(*arguments):
    return [sys.executable, "-m", "ros_bridge", *arguments]


def test_the_list_tells_what_would_be_and_what_can_not_and_ends(ros1, ros2, master):
    ros1.do("advertise", topic="/d/listed", type="std_msgs/String")
    ros1.do("advertise", topic="/d/unlisted", type="rosgraph_msgs/TopicStatistics")
    ros2.publisher("/d/careless", String, BEST_EFFORT)
    ros1.do("publish", topic="/d/listed", values={})
    ros1.expect("published", topic="/d/listed")
    rows: dict = {}

    def listed():  # on a busy machine DDS may need longer to find everybody than the list waits
        run = subprocess.run(bridge_command("--list"), env=master.environment, capture_output=True, text=True, timeout=60, check=False)
        assert run.returncode == 0, run.stderr
        rows.update({line.split()[1]: " ".join(line.split()) for line in run.stdout.splitlines()})
        return "/d/careless" in rows

    wait_until(listed, "the list has what is in ROS 2", 60.0)
    assert "topic /d/listed -> /d/listed std_msgs/String reliable, transient local, 100 offered; nobody subscribes" in rows["/d/listed"]
    assert "topic /d/careless <- /d/careless std_msgs/String best effort, volatile, 100" in rows["/d/careless"]
    assert "/d/unlisted x /d/unlisted can't be: message type rosgraph_msgs/TopicStatistics" in rows["/d/unlisted"]
    assert "/rosout" not in rows


@pytest.mark.parametrize("arguments", [["--all"], ["--list"], ["--include", "/a*"]])
def test_no_master_is_one_clear_error(ros2_domain, arguments):
    nobody = Master(free_port())
    run = subprocess.run(bridge_command(*arguments), env=nobody.environment, capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert f"no ROS master answers at {nobody.uri}: start one" in run.stderr


def test_options_that_ask_for_nothing_are_an_error():
    for arguments, words in (
        ([], "nothing to bridge: give --config FILE, or --all"),
        (["--all", "--namespace2", "x"], "'x' is not an absolute"),
    ):
        run = subprocess.run(bridge_command(*arguments), capture_output=True, text=True, timeout=60, check=False)
        assert run.returncode == 2
        assert words in run.stderr


BAGS = ("embag_luminar_pointcloud2.bag", "foxglove_turtlesim.bag", "robot_localization_test1.bag")
MESSAGES = 25
FOREIGN = "turtlesim/"  # installed in neither world here


@pytest.mark.parametrize("name", BAGS)
def test_recordings_of_others_cross_both_ways_byte_for_byte(name, ros1, ros2, master, bridge):
    """From ROS 1 to ROS 2 as they were recorded; what arrives is sent back under another name, and has to be the recorded bytes."""
    path = bag_folder() / name
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    types = Types(ament_prefixes())
    recorded = read_bag(path)
    pairs = {topic: types.message(kind) for topic, (kind, _) in recorded.items() if not kind.startswith(FOREIGN)}
    there, back = f"/{path.stem}/there", f"/{path.stem}/back"
    player = Ros1Peer(master)
    arrived, publishers = {}, {}
    qos = QoSProfile(depth=1000)
    for topic, pair in pairs.items():
        kind = getattr(__import__(f"{pair.ros2_name.split('/')[0]}.msg", fromlist=["*"]), pair.ros2_name.split("/")[1])
        arrived[topic] = ros2.subscribe(there + topic, kind, qos, raw=True)
        publishers[topic] = ros2.publisher(back + topic, kind, qos)
        player.do("subscribe_raw", topic=back + topic)
    player.do("advertise_bag", path=str(path), prefix=there, number=MESSAGES)
    player.expect("advertised", within_s=20.0)
    for topic in pairs:
        wait_connected(player, ros2, there + topic)
    player.do("play_bag")
    for topic, (_, messages) in recorded.items():
        if topic in pairs:
            ros2.until(lambda topic=topic, messages=messages: len(arrived[topic]) >= len(messages), f"all of {topic} arrives", 30.0)
            for cdr, ros1_bytes in zip(arrived[topic], messages, strict=True):
                wanted = pairs[topic].to_ros2(ros1_bytes)
                assert bytes(cdr) == wanted + bytes(len(cdr) - len(wanted))  # DDS fills up to four bytes
                assert len(cdr) - len(wanted) < 4
            ros2.until(lambda topic=topic: publishers[topic].get_subscription_count() > 0, "the way back is open")
            wait_returned(player, back + topic, arrived[topic], publishers[topic], pairs[topic])
    if len(pairs) < len(recorded):
        wait_until(lambda: any(FOREIGN in line for line in bridge.lines), "types that nobody has are told by name")


def read_bag(path):
    """Return ``{topic: (type, first messages)}``."""
    recorded = {}
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            _, messages = recorded.setdefault(connection.topic, (connection.msgtype.replace("/msg/", "/"), []))
            if len(messages) < MESSAGES:
                messages.append(bytes(data))
    return recorded


def wait_connected(player, ros2, topic):
    def connected():
        player.do("connections", topic=topic)
        return player.expect("connections", topic=topic)["number"]

    ros2.until(connected, f"the bridge is connected to {topic}")


def wait_returned(player, topic, sent, publisher, pair):
    for cdr in sent:
        publisher.publish(bytes(cdr))
        returned = bytes.fromhex(player.expect("message", topic=topic)["hex"])
        start = 4 if pair.begins_with_header else 0  # the bridge counts header.seq itself
        assert returned[start:] == bytes(pair.to_ros1(bytes(cdr)))[start:]
