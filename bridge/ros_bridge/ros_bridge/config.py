"""The bridge's configuration: which topics and services cross, read from YAML with errors that name file, line, key and remedy."""

from __future__ import annotations

import graphlib
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import yaml

from ros_bridge.errors import ConfigError

NAME = re.compile(r"(/[A-Za-z][A-Za-z0-9_]*)+")
TYPE = re.compile(r"[a-z][a-z0-9_]*/[A-Za-z][A-Za-z0-9_]*")


class Direction(Enum):
    """Which way a topic crosses."""

    ROS1_TO_ROS2 = "ros1_to_ros2"
    ROS2_TO_ROS1 = "ros2_to_ros1"


class World(Enum):
    """One of the two worlds; of a service, the one that its server lives in."""

    ROS1 = "ros1"
    ROS2 = "ros2"


class Reliability(Enum):
    """What the ROS 2 end of a topic offers or asks for."""

    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"


@dataclass(frozen=True)
class TopicRoute:
    """A topic that crosses. ``latched`` is ROS 1's latch and ROS 2's transient local; ``depth`` bounds every queue on the way.

    ``type_name`` is ROS 1's type, ``ros2_type`` ROS 2's (both ``package/Name``), empty where the mapping rules tell it.
    """

    ros1_name: str
    ros2_name: str
    direction: Direction
    type_name: str
    latched: bool = False
    depth: int = 10
    reliability: Reliability = Reliability.RELIABLE
    ros2_type: str = ""

    @property
    def label(self) -> str:
        """Name the route for people."""
        return f"topic {_both_names(self)}"

    @property
    def target_name(self) -> str:
        """The name in the world that the messages go to; no two routes share it."""
        return self.ros2_name if self.direction is Direction.ROS1_TO_ROS2 else self.ros1_name


@dataclass(frozen=True)
class ServiceRoute:
    """A service that crosses; ``timeout_s`` (wall clock) bounds a call with all its waiting."""

    ros1_name: str
    ros2_name: str
    server: World
    type_name: str
    timeout_s: float = 5.0
    ros2_type: str = ""

    @property
    def label(self) -> str:
        """Name the route for people."""
        return f"service {_both_names(self)}"

    @property
    def target_name(self) -> str:
        """The name in the world that the callers are in."""
        return self.ros2_name if self.server is World.ROS1 else self.ros1_name


@dataclass(frozen=True)
class ActionRoute:
    """An action that crosses: actionlib in ROS 1, an action in ROS 2.

    ``type_name`` is ``package/Name``, as ROS 2 has it: ROS 1's messages are ``package/NameAction``, ``package/NameGoal`` and so on.
    ``timeout_s`` (wall clock) bounds each waiting for the server's acknowledgement, not the goal's execution.
    """

    ros1_name: str
    ros2_name: str
    server: World
    type_name: str
    timeout_s: float = 5.0
    ros2_type: str = ""

    @property
    def label(self) -> str:
        """Name the route for people."""
        return f"action {_both_names(self)}"

    @property
    def target_name(self) -> str:
        """The name in the world that the clients are in."""
        return self.ros2_name if self.server is World.ROS1 else self.ros1_name


Spec = TopicRoute | ServiceRoute | ActionRoute


def _both_names(spec: Spec) -> str:
    return spec.ros1_name if spec.ros1_name == spec.ros2_name else f"{spec.ros1_name} (ROS 2: {spec.ros2_name})"


@dataclass(frozen=True)
class BridgeConfig:
    """All routes."""

    topics: tuple[TopicRoute, ...] = ()
    services: tuple[ServiceRoute, ...] = ()
    actions: tuple[ActionRoute, ...] = ()

    @property
    def routes(self) -> tuple[Spec, ...]:
        """All of them."""
        return (*self.topics, *self.services, *self.actions)


# A value's reader returns it typed, or raises ValueError with what it should have been.
Reader = Callable[[object], object]
Route = TypeVar("Route", TopicRoute, ServiceRoute, ActionRoute)


def _name(value: object) -> str:
    if isinstance(value, str) and NAME.fullmatch(value):
        return value
    raise ValueError("an absolute ROS name such as /uav_guidance/state")


def _type(value: object) -> str:
    if isinstance(value, str) and TYPE.fullmatch(value):
        return value
    raise ValueError("a type in ROS 1's form, package/Name, such as std_msgs/String")


def _flag(value: object) -> bool:
    if isinstance(value, bool):
        return value
    raise ValueError("true or false")


def _depth(value: object) -> int:
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 100_000:
        return value
    raise ValueError("a number of messages from 1 to 100000")


def _timeout(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= 3600:
        return float(value)
    raise ValueError("a number of seconds above 0 and up to 3600")


def _choice(choices: type[Enum]) -> Reader:
    def read(value: object) -> Enum:
        try:
            return choices(value)
        except ValueError:
            raise ValueError("one of " + ", ".join(choice.value for choice in choices)) from None

    return read


NAMES: Mapping[str, Reader] = {"name": _name, "ros1_name": _name, "ros2_name": _name}
TOPIC_KEYS: Mapping[str, Reader] = {
    **NAMES,
    "direction": _choice(Direction),
    "type": _type,
    "ros2_type": _type,
    "latched": _flag,
    "depth": _depth,
    "reliability": _choice(Reliability),
}
SERVICE_KEYS: Mapping[str, Reader] = {**NAMES, "server": _choice(World), "type": _type, "ros2_type": _type, "timeout_s": _timeout}
SECTIONS: Mapping[str, Mapping[str, Reader]] = {"topics": TOPIC_KEYS, "services": SERVICE_KEYS, "actions": SERVICE_KEYS}


def load_config(paths: Iterable[Path]) -> BridgeConfig:
    """Read one or several files as one configuration.

    Raises:
        ConfigError: A file can't be read, a key or value is wrong, or routes meet each other.
    """
    configs = [parse_config(_read(path), str(path)) for path in paths]
    merged = BridgeConfig(
        tuple(route for config in configs for route in config.topics),
        tuple(route for config in configs for route in config.services),
        tuple(route for config in configs for route in config.actions),
    )
    _require_apart(merged)
    return merged


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: can't be read: {error}") from error


def parse_config(text: str, file: str) -> BridgeConfig:
    """Read one file's text; ``file`` is its name for messages. Raises ConfigError."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise ConfigError(f"{file}:{line}: no YAML: {error.problem}") from error
    entries: dict[str, list[tuple[int, dict[str, Any]]]] = {section: [] for section in SECTIONS}
    for section, node, line in _pairs(root, file) if root is not None else ():
        if section not in SECTIONS:
            raise ConfigError(f"{file}:{line}: unknown key '{section}'; known are {', '.join(SECTIONS)}")
        if not isinstance(node, yaml.SequenceNode):
            raise ConfigError(f"{file}:{line}: '{section}' has to be a list of entries, each with a name")
        entries[section] = [(item.start_mark.line + 1, _entry(item, SECTIONS[section], file)) for item in node.value]
    return BridgeConfig(
        tuple(_route(TopicRoute, values, ("direction", "type"), f"{file}:{line}") for line, values in entries["topics"]),
        tuple(_route(ServiceRoute, values, ("server", "type"), f"{file}:{line}") for line, values in entries["services"]),
        tuple(_route(ActionRoute, values, ("server", "type"), f"{file}:{line}") for line, values in entries["actions"]),
    )


def _pairs(node: yaml.Node, file: str) -> Iterable[tuple[str, yaml.Node, int]]:
    """Yield a mapping's keys, value nodes and lines; a key that is there twice is an error, not a choice."""
    if not isinstance(node, yaml.MappingNode):
        raise ConfigError(f"{file}:{node.start_mark.line + 1}: expected keys and values here, such as 'name: /clock'")
    seen: set[str] = set()
    for key, value in node.value:
        if key.value in seen:
            raise ConfigError(f"{file}:{key.start_mark.line + 1}: key '{key.value}' is given twice; keep one")
        seen.add(key.value)
        yield str(key.value), value, key.start_mark.line + 1


def _entry(node: yaml.Node, readers: Mapping[str, Reader], file: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value_node, line in _pairs(node, file):
        if key not in readers:
            raise ConfigError(f"{file}:{line}: unknown key '{key}'; known are {', '.join(readers)}")
        value = yaml.SafeLoader("").construct_object(value_node, deep=True)
        try:
            values[key] = readers[key](value)
        except ValueError as expected:
            raise ConfigError(f"{file}:{line}: {key}: {value!r} is not {expected}") from None
    return values


def _route(kind: type[Route], values: dict[str, Any], required: tuple[str, ...], place: str) -> Route:
    name = values.pop("name", None)
    if name is None and not {"ros1_name", "ros2_name"} <= values.keys():
        raise ConfigError(f"{place}: no name; give 'name', or 'ros1_name' and 'ros2_name'")
    for key in required:
        if key not in values:
            raise ConfigError(f"{place}: '{key}' is missing for {name or values['ros1_name']}")
    values.setdefault("ros1_name", name)
    values.setdefault("ros2_name", name)
    values["type_name"] = values.pop("type")
    return kind(**values)


def _require_apart(config: BridgeConfig) -> None:
    """Refuse two routes into one name, and routes that lead a message back to where it came from."""
    targets: set[tuple[str, Enum, str]] = set()
    for route in config.routes:
        way = route.direction if isinstance(route, TopicRoute) else route.server
        target = (type(route).__name__, way, route.target_name)
        if target in targets:
            raise ConfigError(f"{route.target_name}: two routes lead there ({way.value}); keep one, or rename one")
        targets.add(target)
    graph: dict[tuple[World, str], set[tuple[World, str]]] = {}
    for topic in config.topics:
        ends = [(World.ROS1, topic.ros1_name), (World.ROS2, topic.ros2_name)]
        source, target_end = ends if topic.direction is Direction.ROS1_TO_ROS2 else reversed(ends)
        graph.setdefault(target_end, set()).add(source)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        names = " -> ".join(f"{world.value}:{name}" for world, name in reversed(error.args[1]))
        raise ConfigError(f"messages would go round in circles: {names}; bridge a topic one way, or rename an end") from error
