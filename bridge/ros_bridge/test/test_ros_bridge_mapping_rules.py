"""The mapping rules of ``ros1_bridge``, read as they are; names that only one world can have."""

import struct
from pathlib import Path

import pytest
from ros_bridge_definitions import types_of

from ros_bridge.config import Direction, TopicRoute
from ros_bridge.config_file import load_config, read_config
from ros_bridge.decisions import Refused, RouteDecision, decide
from ros_bridge.errors import ConfigError
from ros_bridge.graph import Graphs, Ros1Graph, Ros2Endpoint, Ros2Graph
from ros_bridge.selection import Selection

RULES = """
-
  ros1_package_name: 'old_msgs'
  ros2_package_name: 'new_msgs'
-
  ros1_package_name: 'old_msgs'
  ros1_message_name: 'Track'
  ros2_package_name: 'new_msgs'
  ros2_message_name: 'TrackInfo'
  fields_1_to_2:
    header.stamp: 'at'
    size: 'count'
  enable_foreign_mappings: true
-
  ros1_package_name: old_srvs
  ros1_service_name: Ask
  ros2_package_name: new_srvs
  ros2_service_name: Query
  request_fields_1_to_2:
    text: 'question'
"""


def test_packages_messages_and_services_of_ros1_bridge(tmp_path):
    path, more = tmp_path / "mapping_rules.yaml", tmp_path / "bridge.yaml"
    path.write_text(RULES)
    more.write_text("types: {packages: {p: q}}\n")
    rules = load_config([path, more]).rules
    assert [rules.to_ros2(name) for name in ("old_msgs/Other", "old_msgs/Track", "old_srvs/Ask", "p/M")] == [
        "new_msgs/Other", "new_msgs/TrackInfo", "new_srvs/Query", "q/M",
    ]  # fmt: skip
    types = types_of(
        tmp_path,
        {"old_msgs/Track": "Header header\nint32 size\nstring note\n", "old_srvs/srv/Ask": "string text\nint8 how\n---\nbool ok\n"},
        {
            "new_msgs/TrackInfo": "int32 count\nbuiltin_interfaces/Time at\nfloat64 quality\n",
            "new_srvs/srv/Query": "string question\nint64 limit\n---\nbool ok\n",
        },
        rules,
    )
    pair = types.message("old_msgs/Track")  # a rule with fields names all that cross
    assert pair.to_ros2(struct.pack("<IIIIiI1s", 9, 5, 6, 0, 7, 1, b"x"))[4:] == struct.pack("<iII4xd", 7, 5, 6, 0.0)
    service = types.service("old_srvs/Ask")
    assert (service.ros2_name, service.response.same_layout) == ("new_srvs/Query", True)
    assert service.request.to_ros2(struct.pack("<I1sb", 1, b"x", 3))[4:10] == struct.pack("<I2s", 2, b"x\0")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("- {ros1_package_name: a}", ":1: a mapping rule has no `ros2_package_name`"),
        ("- {ros1_package_name: a, ros2_package_name: b, ros1_message_name: M}", ":1: a mapping rule has no `ros2_message_name`"),
        (
            "- {ros1_package_name: a, ros2_package_name: b, ros1_mesage_name: M}",
            ":1: a mapping rule has no `ros1_mesage_name`; it may have",
        ),
        (
            "- {ros1_package_name: a, ros2_package_name: b, ros1_message_name: M, ros2_message_name: M, fields_1_to_2: {}}",
            "`fields_1_to_2` has to",
        ),
        ("- 5", ":1: a mapping rule should be a mapping"),
    ],
)
def test_rules_that_are_none_name_their_place(tmp_path, text, words):
    path = tmp_path / "mapping_rules.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_config(path)
    assert str(caught.value).startswith(str(path))
    assert words in str(caught.value)


LIVOX = "/livox/192_168_1_10"


def configured(tmp_path, text):
    path = Path(tmp_path / "b.yaml")
    path.write_text(text)
    return read_config(path)


def test_a_name_with_a_leading_digit_is_one_of_ros1_alone(tmp_path):
    route = f"topics: [{{ros1_name: {LIVOX}, ros2_name: /livox/lidar, direction: ros1_to_ros2, type: std_msgs/String}}]"
    assert configured(tmp_path, route).topics == (TopicRoute(LIVOX, "/livox/lidar", Direction.ROS1_TO_ROS2, "std_msgs/String"),)
    assert configured(tmp_path, f"discover: {{rename: {{{LIVOX}: /livox/lidar}}}}").selection.renames == ((LIVOX, "/livox/lidar"),)
    for wrong in (route.replace("ros1_name", "name"), route.replace("/livox/lidar", LIVOX), f"discover: {{rename: {{/livox: {LIVOX}}}}}"):
        with pytest.raises(ConfigError, match="no part begins with a digit, which only ROS 1 allows"):
            configured(tmp_path, wrong)


class AnyType:
    def pair(self, ros1_type, ros2_type, topic):
        from ros_bridge.checked_types import CheckedPair

        return CheckedPair(ros1_type, ros2_type or ros1_type)


def test_a_discovered_name_with_a_leading_digit_is_refused_until_it_is_renamed():
    graph = Ros1Graph({LIVOX: frozenset({"/n"})}, {}, types={LIVOX: "std_msgs/String"})
    graphs = Graphs(graph, Ros2Graph(subscribers={"/livox/lidar": (Ros2Endpoint("/n", "std_msgs/String"),)}))
    (refused,) = decide(graphs, Selection(("*",)), AnyType())
    assert isinstance(refused, Refused)
    assert f"(rename: {{{LIVOX}: /NAME}})" in refused.reason
    (renamed,) = decide(graphs, Selection(("*",), renames=((LIVOX, "/livox/lidar"),)), AnyType())
    assert isinstance(renamed, RouteDecision)
    assert renamed.receivers == 1
