"""Configuration errors name file, line, value and remedy; routes can't meet or go round in circles."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from alula.language.robot import BridgedAction, BridgedService, BridgedTopic
from ros_bridge.config import BridgeConfig, Direction, Reliability, RosVersion, ServiceRoute, TopicRoute
from ros_bridge.config_file import KEYS, SERVICE_KEYS, TOPIC_KEYS, load_config, read_config
from ros_bridge.conversion import Types, ament_prefixes
from ros_bridge.errors import ConfigError
from ros_bridge.node import may_send_bulk
from ros_bridge.selection import Selection


@pytest.fixture
def parsed(tmp_path, monkeypatch):
    """Return a function that reads a text as the file ``b.yaml``."""
    monkeypatch.chdir(tmp_path)

    def parse(text):
        path = Path("b.yaml")
        path.write_text(text)
        return read_config(path)

    return parse


GOOD = """
topics:
  - {name: /clock, direction: ros1_to_ros2, type: rosgraph_msgs/Clock}
  - ros1_name: /old
    ros2_name: /new
    direction: ros2_to_ros1
    type: std_msgs/String
    latched: true
    depth: 1
    reliability: best_effort
services:
  - {name: /uav_guidance/takeoff, server: ros1, type: uav_msgs/Takeoff, timeout_s: 2}
"""


def test_reads_all_keys_and_defaults(parsed):
    config = parsed(GOOD)
    assert config.topics == (
        TopicRoute("/clock", "/clock", Direction.ROS1_TO_ROS2, "rosgraph_msgs/Clock", latched=False, depth=10),
        TopicRoute("/old", "/new", Direction.ROS2_TO_ROS1, "std_msgs/String", latched=True, depth=1, reliability=Reliability.BEST_EFFORT),
    )
    assert config.services == (ServiceRoute("/uav_guidance/takeoff", "/uav_guidance/takeoff", RosVersion.ROS1, "uav_msgs/Takeoff", 2.0),)


def test_a_robots_bindings_have_the_keys_of_routes():
    assert {*TOPIC_KEYS, *SERVICE_KEYS} == set(KEYS)
    assert {field.name for field in fields(BridgedTopic)} == set(TOPIC_KEYS)
    assert {field.name for field in fields(BridgedService)} == {field.name for field in fields(BridgedAction)} == set(SERVICE_KEYS)


DISCOVERED = """
discover:
  all: true
  include: ["/camera/*"]
  exclude: [/secret, '*/raw']
  namespace2: /ros1
  rename: {/old: /new, /clock: /clock}
  parameters: false
types:
  packages: {old_msgs: new_msgs}
  messages:
    - {ros1: tf/tfMessage, ros2: tf2_msgs/TFMessage}
    - ros1: old_msgs/Pose
      ros2: new_msgs/Place
      fields: {header.stamp: at, junk: ''}
"""


def test_reads_what_to_discover_and_how_types_map(parsed):
    config = parsed(DISCOVERED)
    assert config.selection == Selection(
        ("/camera/*", "*"), ("/secret", "*/raw"), "", "/ros1", (("/old", "/new"), ("/clock", "/clock")), parameters=False
    )
    assert config.rules.to_ros2("old_msgs/Pose") == "new_msgs/Place"
    assert config.rules.to_ros2("old_msgs/Other") == "new_msgs/Other"
    assert config.rules.fields("old_msgs/Pose", "new_msgs/Place") == {"header.stamp": "at", "junk": ""}


def test_files_and_command_line_are_one_selection(tmp_path):
    (tmp_path / "a.yaml").write_text("discover: {include: [/a], namespace2: /x}\ntypes: {packages: {p: q}}\n")
    (tmp_path / "b.yaml").write_text("discover: {exclude: [/b]}\ntypes: {packages: {r: s}}\n")
    paths = [tmp_path / "a.yaml", tmp_path / "b.yaml"]
    config = load_config(paths, Selection(("/c",), namespace2="/x"))
    assert config.selection == Selection(("/a", "/c"), ("/b",), "", "/x")
    assert [config.rules.to_ros2(name) for name in ("p/M", "r/M")] == ["q/M", "s/M"]
    with pytest.raises(ConfigError, match="namespace2: given as /x and as /y; keep one"):
        load_config(paths, Selection(namespace2="/y"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("discover: {al: true}", "b.yaml:1: 'discover' has no `al`; it may have all, include"),
        ("discover:\n  include: /camera", "b.yaml:2: include: '/camera' is not a list of patterns"),
        ("discover: {rename: {a: /b}}", "is not an absolute ROS name"),
        ("types: {package: {}}", "b.yaml:1: 'types' has no `package`; it may have packages, messages, services"),
        ("types: {packages: [a]}", "packages: \\['a'\\] is not keys and values"),
        ("types:\n  messages:\n    - {ros1: a/B}", "b.yaml:3: a rule needs 'ros1' and 'ros2'"),
        ("types:\n  messages:\n    - {ros1: a/B, ros2: a/B, fields: {'a b': c}}", "b.yaml:3: fields: .* is not a field's name"),
    ],
)
def test_errors_of_discovery_and_types_name_their_place(parsed, text, words):
    with pytest.raises(ConfigError, match=words):
        parsed(text)


def test_empty_file_is_an_empty_configuration(parsed):
    assert parsed("").topics == ()


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("topcis: []", 1, ["the configuration has no `topcis`", "topics, services, actions, discover, types"]),
        ("topics: 3", 1, ["'topics' has to be a list"]),
        ("topics:\n  - /clock", 2, ["should be a mapping"]),
        ("topics:\n  - name: /a\n    directoin: x", 3, ["a route has no `directoin`", "did you mean", "direction"]),
        ("topics:\n  - {name: /a, direction: up, type: a/B}", 2, ["'up' is not one of ros1_to_ros2, ros2_to_ros1"]),
        ("topics:\n  - {name: a, direction: ros1_to_ros2, type: a/B}", 2, ["'a' is not an absolute ROS name"]),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2, type: a/msg/B}", 2, ["'a/msg/B' is not a type in ROS 1's form"]),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2}", 2, ["'type' is missing for /a"]),
        ("topics:\n  - {direction: ros1_to_ros2, type: a/B}", 2, ["no name"]),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2, type: a/B,\n     depth: 0}", 3, ["depth: 0 is not a number of messages"]),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2, type: a/B, depth: true}", 2, ["depth: True is not"]),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2, type: a/B, latched: 1}", 2, ["latched: 1 is not true or false"]),
        ("topics:\n  - {name: /a, name: /b}", 2, ["`name` is given twice"]),
        ("services:\n  - {name: /a, server: ros3, type: a/B}", 2, ["'ros3' is not one of ros1, ros2"]),
        ("services:\n  - {name: /a, server: ros1, type: a/B, timeout_s: -1}", 2, ["timeout_s: -1 is not a number of seconds"]),
        ("services:\n  - {name: /a, server: ros1, type: a/B, depth: 1}", 2, ["a route has no `depth`"]),
        ("topics: [", 1, ["is no YAML"]),
    ],
)
def test_errors_name_place_value_and_remedy(parsed, text, line, words):
    with pytest.raises(ConfigError, match=re.escape(f"b.yaml:{line}: ")) as caught:
        parsed(text)
    for word in words:
        assert word in str(caught.value)


def test_file_that_is_not_there(tmp_path):
    with pytest.raises(ConfigError, match="can't be read"):
        load_config([tmp_path / "none.yaml"])


def route(source, target, direction):
    one, two = (source, target) if direction == "ros1_to_ros2" else (target, source)
    return f"  - {{ros1_name: {one}, ros2_name: {two}, direction: {direction}, type: std_msgs/String}}\n"


@pytest.mark.parametrize(
    "routes",
    [
        [("/a", "/a", "ros1_to_ros2"), ("/a", "/a", "ros2_to_ros1")],
        [("/a", "/b", "ros1_to_ros2"), ("/b", "/c", "ros2_to_ros1"), ("/c", "/d", "ros1_to_ros2"), ("/d", "/a", "ros2_to_ros1")],
    ],
)
def test_circles_are_refused(tmp_path, routes):
    path = tmp_path / "b.yaml"
    path.write_text("topics:\n" + "".join(route(*one) for one in routes))
    with pytest.raises(ConfigError, match=r"circles: .*ros1:/a"):
        load_config([path])


def test_a_chain_that_does_not_close_is_no_circle(tmp_path):
    path = tmp_path / "b.yaml"
    path.write_text("topics:\n" + route("/a", "/b", "ros1_to_ros2") + route("/b", "/c", "ros2_to_ros1"))
    assert len(load_config([path]).topics) == 2


def test_two_routes_into_one_name_are_refused_over_several_files(tmp_path):
    for name in ("a.yaml", "b.yaml"):
        (tmp_path / name).write_text(f"topics:\n{route('/' + name[0], '/same', 'ros1_to_ros2')}")
    assert len(load_config([tmp_path / "a.yaml"]).topics) == 1
    with pytest.raises(ConfigError, match="/same: two routes lead there"):
        load_config([tmp_path / "a.yaml", tmp_path / "b.yaml"])


def test_only_what_is_sent_in_ros_2_decides_how_much_shared_memory_the_bridge_takes():
    types = Types(ament_prefixes())

    def route(kind, direction=Direction.ROS1_TO_ROS2):
        return TopicRoute("/it", "/it", direction, kind)

    for config, bulk in (
        (BridgeConfig(), False),
        (BridgeConfig((route("uav_msgs/Obstacle"), route("rosgraph_msgs/Clock"))), False),
        (BridgeConfig((route("rosgraph_msgs/Clock"), route("sensor_msgs/PointCloud2"))), True),
        (BridgeConfig((route("sensor_msgs/Image"),)), True),
        (BridgeConfig((route("sensor_msgs/Image", Direction.ROS2_TO_ROS1),)), False),
        (BridgeConfig((route("nobody_msgs/Nothing"),)), False),  # told when the route is opened
        (BridgeConfig(selection=Selection(include=("*",))), True),  # nobody knows yet what
    ):
        assert may_send_bulk(config, types) is bulk, config
