"""Read the configuration from YAML, with errors that name file, line, key and remedy."""

from __future__ import annotations

import graphlib
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from alula.common.keys import Key
from alula.common.located_yaml import Located, read_yaml
from ros_bridge import config_values
from ros_bridge.config import ActionRoute, BridgeConfig, Direction, Reliability, RosVersion, ServiceRoute, TopicRoute
from ros_bridge.config_values import Reader
from ros_bridge.discovery_options import READERS, below, make_selection, merge_selections
from ros_bridge.errors import ConfigError
from ros_bridge.mapping import TypeRule, TypeRules
from ros_bridge.mapping_rules import read_mapping_rules
from ros_bridge.selection import Selection

Route = TypeVar("Route", TopicRoute, ServiceRoute, ActionRoute)


NAMES: Mapping[str, Reader] = {"name": config_values.name, "ros1_name": config_values.ros1_name, "ros2_name": config_values.name}
TOPIC_KEYS: Mapping[str, Reader] = {
    **NAMES,
    "direction": config_values.choice(Direction),
    "type": config_values.type_name,
    "ros2_type": config_values.type_name,
    "latched": config_values.flag,
    "depth": config_values.depth,
    "reliability": config_values.choice(Reliability),
}
SERVICE_KEYS: Mapping[str, Reader] = {
    **NAMES,
    "server": config_values.choice(RosVersion),
    "type": config_values.type_name,
    "ros2_type": config_values.type_name,
    "timeout_s": config_values.timeout,
}
RULE_KEYS: Mapping[str, Reader] = {
    "ros1": config_values.type_name,
    "ros2": config_values.type_name,
    "fields": config_values.mapping(config_values.field_path, config_values.field_path),
}
SECTIONS = ("topics", "services", "actions", "discover", "types")
_TOPIC = TopicRoute("", "", Direction.ROS1_TO_ROS2, "")
_SERVICE = ServiceRoute("", "", RosVersion.ROS1, "")
KEYS: Mapping[str, Key] = {
    "name": Key("of both worlds, absolute", "`ros1_name` and `ros2_name`"),
    "ros1_name": Key("of ROS 1; parts of it may begin with a digit, which ROS 2 does not allow", "`name`"),
    "ros2_name": Key("of ROS 2", "`name`"),
    "direction": Key("of a topic: `ros1_to_ros2` or `ros2_to_ros1`", "needed"),
    "server": Key("of a service or action: the world that the server is in, `ros1` or `ros2`", "needed"),
    "type": Key("ROS 1's form, `package/Name`", "needed"),
    "ros2_type": Key("ROS 2's type, where the rules do not have it", "by the rules"),
    "latched": Key("ROS 1: latching; ROS 2: transient local, which the publisher has to be, too", str(_TOPIC.latched).lower()),
    "depth": Key("bounds the queues on the way; the oldest message gives way", str(_TOPIC.depth)),
    "reliability": Key("of the ROS 2 end; `best_effort` is needed for a publisher that offers no more", f"`{_TOPIC.reliability.value}`"),
    "timeout_s": Key(
        "wall clock; of a call with all its waiting; of an action, how long a goal waits for its answer", f"{_SERVICE.timeout_s:g}"
    ),
}
"""What the manual says of the keys of routes (docs/reference/bridge.md)."""


def load_config(paths: Iterable[Path], selection: Selection | None = None, namespace: str = "") -> BridgeConfig:
    """Read one or several files as one configuration; ``selection`` (the command line's) is added to theirs.

    ROS 1's names lie below ``namespace`` in ROS 2, where nothing else is said of a name.

    Raises:
        ConfigError: A file can't be read, a key or value is wrong, or routes meet each other.
    """
    configs = [read_config(path, namespace) for path in paths]
    merged = BridgeConfig(
        tuple(route for config in configs for route in config.topics),
        tuple(route for config in configs for route in config.services),
        tuple(route for config in configs for route in config.actions),
        below(namespace, merge_selections([*(config.selection for config in configs), *([selection] if selection is not None else [])])),
        merge_rules(config.rules for config in configs),
    )
    _require_apart(merged)
    return merged


def merge_rules(rules: Iterable[TypeRules]) -> TypeRules:
    """Return the rules of all."""
    rules = list(rules)
    packages = {ros1: ros2 for one in rules for ros1, ros2 in one.packages.items()}
    return TypeRules(packages, [rule for one in rules for rule in one.own])


def read_config(path: Path, namespace: str = "") -> BridgeConfig:
    """Read one file, for a bridge in a namespace of ROS 2; a list is ``ros1_bridge``'s mapping rules. Raises ConfigError."""
    root = read_yaml(path, ConfigError)
    if root is not None and root.is_list:
        return BridgeConfig(rules=read_mapping_rules(root))
    sections = root.record("the configuration", SECTIONS) if root is not None else {}
    return BridgeConfig(
        tuple(_route(TopicRoute, item, TOPIC_KEYS, "direction", namespace) for item in _items(sections, "topics")),
        tuple(_route(ServiceRoute, item, SERVICE_KEYS, "server", namespace) for item in _items(sections, "services")),
        tuple(_route(ActionRoute, item, SERVICE_KEYS, "server", namespace) for item in _items(sections, "actions")),
        make_selection(_entry(sections["discover"], "'discover'", READERS)) if "discover" in sections else Selection(),
        _rules(sections["types"]) if "types" in sections else TypeRules(),
    )


def _rules(types: Located) -> TypeRules:
    parts = types.record("'types'", ("packages", "messages", "services"))
    packages = (
        _value(parts["packages"], "packages", config_values.mapping(config_values.package, config_values.package))
        if "packages" in parts
        else {}
    )
    return TypeRules(packages, [_rule(item) for key in ("messages", "services") for item in _items(parts, key)])


def _rule(item: Located) -> TypeRule:
    values = _entry(item, "a rule", RULE_KEYS)
    if not {"ros1", "ros2"} <= values.keys():
        raise item.wrong("a rule needs 'ros1' and 'ros2', each a type")
    return TypeRule(**values)


def _items(parts: Mapping[str, Located], key: str) -> list[Located]:
    if key not in parts:
        return []
    if not parts[key].is_list:
        raise parts[key].wrong(f"'{key}' has to be a list of entries")
    return parts[key].elements()


def _entry(part: Located, what: str, readers: Mapping[str, Reader]) -> dict[str, Any]:
    return {key: _value(value, key, readers[key]) for key, value in part.record(what, readers).items()}


def _value(part: Located, key: str, reader: Reader) -> Any:
    value = part.value
    try:
        return reader(value)
    except ValueError as expected:
        raise part.wrong(f"{key}: {value!r} is not {expected}") from None


def _route(kind: type[Route], item: Located, readers: Mapping[str, Reader], way: str, namespace: str) -> Route:
    values = _entry(item, "a route", readers)
    name = values.pop("name", None)
    if name is None and not {"ros1_name", "ros2_name"} <= values.keys():
        raise item.wrong("no name; give 'name', or 'ros1_name' and 'ros2_name'")
    for key in (way, "type"):
        if key not in values:
            raise item.wrong(f"'{key}' is missing for {name or values['ros1_name']}")
    values.setdefault("ros1_name", name)
    values.setdefault("ros2_name", f"{namespace}{name}")
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
    graph: dict[tuple[RosVersion, str], set[tuple[RosVersion, str]]] = {}
    for topic in config.topics:
        ends = [(RosVersion.ROS1, topic.ros1_name), (RosVersion.ROS2, topic.ros2_name)]
        source, target_end = ends if topic.direction is Direction.ROS1_TO_ROS2 else reversed(ends)
        graph.setdefault(target_end, set()).add(source)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        names = " -> ".join(f"{world.value}:{name}" for world, name in reversed(error.args[1]))
        raise ConfigError(f"messages would go round in circles: {names}; bridge a topic one way, or rename an end") from error
