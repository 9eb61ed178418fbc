"""`./alula bridge --all` and `--list` as processes: what they tell of routes, of what can't be bridged, and of wrong options."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from ros_bridge_harness import Master
from ros_bridge_nodes import BEST_EFFORT, paced
from std_msgs.msg import String

from alula.common.network import free_port
from alula_testing.waits import until
from ros_bridge.ros2_graph import UNNAMED, all_named

CONFIG = "discover: {all: true}"


def test_a_type_that_can_not_cross_is_told_once_by_its_name(ros1, ros2_node, bridge):
    for topic in ("/d/none_1", "/d/none_2"):
        ros1.do("advertise", topic=topic, type="rosgraph_msgs/TopicStatistics")
    until(lambda: any("rosgraph_msgs/TopicStatistics" in line for line in bridge.lines), "it is told")
    statuses = ros2_node.subscribe("/diagnostics", DiagnosticArray)
    ros2_node.until(lambda: statuses and any("/d/none_2" in status.name for status in statuses[-1].status), "the diagnostics name both")
    assert sum("rosgraph_msgs/TopicStatistics" in line for line in bridge.lines) == 1


def test_diagnostics_tell_every_route_in_both_worlds(ros1, ros2_node, bridge):
    statuses = ros2_node.subscribe("/diagnostics", DiagnosticArray)
    ros1.do("subscribe", topic="/diagnostics", type="diagnostic_msgs/DiagnosticArray")
    ros2_node.subscribe("/d/told", String)
    ros1.do("advertise", topic="/d/told", type="std_msgs/String", latch=True)
    ros1.do("publish", topic="/d/told", values={"data": "12345678"})

    def told():
        found = [status for array in statuses[-1:] for status in array.status if status.name == "ros_bridge: topic /d/told"]
        values = {item.key: item.value for item in found[0].values} if found else {}
        return values.get("count") == "1" and values["type"] == "std_msgs/String" and int(values["bytes"]) > 8

    ros2_node.until(told, "the count arrives")
    while b"ros_bridge: topic /d/told" not in bytes.fromhex(ros1.expect("message", topic="/diagnostics")["hex"]):
        pass
    until(lambda: json.loads(bridge.stats_file.read_text())["topics"].get("/d/told", {}).get("count") == 1, "the file has it")


def test_a_topic_that_the_bridge_publishes_itself_crosses_beside_its_own_messages(ros1, ros2_node, bridge):
    """The bridge's node has two publishers of /diagnostics in ROS 1 then: a subscriber that was there before the second one hears both."""
    ros1.do("subscribe", topic="/diagnostics", type="diagnostic_msgs/DiagnosticArray")
    ros1.expect("message", topic="/diagnostics")
    publisher = ros2_node.publisher("/diagnostics", DiagnosticArray)
    foreign = DiagnosticArray(status=[DiagnosticStatus(name="motor 7")])
    probe = paced(lambda: publisher.publish(foreign))

    def both_arrive():
        probe()
        heard = [line for line in ros1.lines if "/diagnostics" in line]
        return any(b"motor 7".hex() in line for line in heard)

    ros2_node.until(both_arrive, "what a ROS 2 node says arrives")
    ros2_node.node.destroy_publisher(publisher)
    while b"ros_bridge: " not in bytes.fromhex(ros1.expect("message", topic="/diagnostics")["hex"]):
        pass  # and the bridge goes on with its own


def bridge_command(*arguments):
    return [sys.executable, "-m", "ros_bridge", *arguments]


def listed(master, topic):
    """Return the rows of ``--list`` by the names in ROS 1, a row of the topic among them.

    On a busy machine DDS may need longer to find all nodes than the list waits.
    """
    rows: dict = {}

    def has_topic():
        run = subprocess.run(bridge_command("--list"), env=master.environment, capture_output=True, text=True, timeout=60, check=False)
        assert run.returncode == 0, run.stderr
        rows.update({line.split()[1]: " ".join(line.split()) for line in run.stdout.splitlines()})
        return topic in rows

    try:
        until(has_topic, f"the list has {topic}")
    except AssertionError as error:
        error.add_note(f"it had {sorted(rows)}")
        raise
    return rows


@pytest.mark.parametrize(
    ("publisher", "kind", "named"),
    [("camera", "std_msgs/msg/String", True), (UNNAMED, "std_msgs/msg/String", False), (UNNAMED, "ShapeType", True)],
)
def test_a_node_that_is_not_known_yet_by_its_name_is_waited_for(publisher, kind, named):
    """DDS tells of a topic before it tells whose it is; the list leaves out what is nobody's, and what is not of ROS never has a node."""
    node = SimpleNamespace(
        get_topic_names_and_types=lambda: [("/d/seen", [kind])],
        get_publishers_info_by_topic=lambda _: [SimpleNamespace(node_name=publisher, topic_type=kind)],
        get_subscriptions_info_by_topic=lambda _: [SimpleNamespace(node_name="viewer", topic_type=kind)],
    )
    assert all_named(node) is named


def test_the_list_tells_what_would_be_and_what_can_not_and_ends(ros1, ros2_node, master):
    ros1.do("advertise", topic="/d/listed", type="std_msgs/String")
    ros1.do("advertise", topic="/d/unlisted", type="rosgraph_msgs/TopicStatistics")
    ros2_node.publisher("/d/careless", String, BEST_EFFORT)
    ros1.do("publish", topic="/d/listed", values={})
    ros1.expect("published", topic="/d/listed")
    rows = listed(master, "/d/careless")
    assert "topic /d/listed -> /d/listed std_msgs/String reliable, transient local, 100 offered; no subscriber" in rows["/d/listed"]
    assert "topic /d/careless <- /d/careless std_msgs/String best effort, volatile, 100" in rows["/d/careless"]
    assert "/d/unlisted x /d/unlisted can't be: message type rosgraph_msgs/TopicStatistics" in rows["/d/unlisted"]
    assert "/rosout" not in rows


def test_a_type_that_the_worlds_lay_out_differently_is_told_and_listed_with_the_field(ros1, ros2_node, master, bridge):
    definition = "float64 uuid\n"  # ROS 1 does not have the type: the publisher's definition counts
    ros1.do("advertise_own", topic="/d/differs", type="unique_identifier_msgs/UUID", definition=definition)
    reason = "message type unique_identifier_msgs/UUID differs: field 'uuid' is float64 in ROS 1, 'uuid' is uint8[16] in ROS 2"
    until(lambda: any(reason in line for line in bridge.lines), "it is told")
    statuses = ros2_node.subscribe("/diagnostics", DiagnosticArray)

    def shown():
        return {status.message for array in statuses[-1:] for status in array.status if "/d/differs" in status.name}

    ros2_node.until(shown, "the diagnostics name it")
    assert all(reason in message for message in shown())
    assert listed(master, "/d/differs")["/d/differs"] == f"topic /d/differs x /d/differs can't be: {reason}"


def test_a_type_that_only_its_publisher_has_is_told_by_its_name(ros1, bridge):
    ros1.do("advertise_own", topic="/d/foreign", type="turtlesim/Pose", definition="float32 x\nfloat32 y\n")
    until(lambda: any("message type turtlesim/Pose" in line for line in bridge.lines), "it is told")


@pytest.mark.parametrize("arguments", [["--all"], ["--list"], ["--include", "/a*"]])
def test_no_master_is_one_clear_error(ros2_domain, arguments):
    no_master = Master(free_port())
    run = subprocess.run(bridge_command(*arguments), env=no_master.environment, capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert f"no ROS master answers at {no_master.uri}: start one" in run.stderr


def test_options_that_ask_for_nothing_are_an_error():
    for arguments, words in (
        ([], "nothing to bridge: give --config FILE, or --all"),
        (["--all", "--namespace2", "x"], "'x' is not an absolute"),
        (["--all", "--ros-args", "-r", "__ns:=rover"], "__ns:=rover is not an absolute ROS name such as"),
    ):
        run = subprocess.run(bridge_command(*arguments), capture_output=True, text=True, timeout=60, check=False)
        assert run.returncode == 2
        assert words in run.stderr
