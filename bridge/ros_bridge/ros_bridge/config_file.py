"""Read the configuration from YAML, with errors that name file, line, key and remedy."""

from __future__ import annotations

import graphlib
import re
from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from alula_common.located_yaml import Located, read_yaml
from ros_bridge.config import ActionRoute, BridgeConfig, Direction, Reliability, RosVersion, ServiceRoute, TopicRoute
from ros_bridge.errors import ConfigError
from ros_bridge.mapping import TypeRule, TypeRules
from ros_bridge.selection import Selection

NAME = re.compile(r"(/[A-Za-z][A-Za-z0-9_]*)+")
TYPE = re.compile(r"[a-z][a-z0-9_]*/[A-Za-z][A-Za-z0-9_]*")
PACKAGE = re.compile(r"[a-z][a-z0-9_]*")
PATTERN = re.compile(r"[/*?\[][^\s]*")
FIELD = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)*")


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


def _package(value: object) -> str:
    if isinstance(value, str) and PACKAGE.fullmatch(value):
        return value
    raise ValueError("a package's name such as sensor_msgs")


def _patterns(value: object) -> tuple[str, ...]:
    if isinstance(value, list) and all(isinstance(item, str) and PATTERN.fullmatch(item) for item in value):
        return tuple(value)
    raise ValueError("a list of patterns such as [/camera/*, '*/odom']")


def _field(value: object) -> str:
    if isinstance(value, str) and (not value or FIELD.fullmatch(value)):
        return value
    raise ValueError("a field's name, with dots into its parts, such as header.stamp; '' leaves it out")


def _mapping(key_reader: Reader, value_reader: Reader) -> Reader:
    def read(value: object) -> dict[object, object]:
        if not isinstance(value, dict):
            raise ValueError("keys and values, such as {old: new}")  # noqa: TRY004 - as all readers do
        return {key_reader(key): value_reader(item) for key, item in value.items()}

    return read


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
SERVICE_KEYS: Mapping[str, Reader] = {**NAMES, "server": _choice(RosVersion), "type": _type, "ros2_type": _type, "timeout_s": _timeout}
RULE_KEYS: Mapping[str, Reader] = {"ros1": _type, "ros2": _type, "fields": _mapping(_field, _field)}
DISCOVER_KEYS: Mapping[str, Reader] = {
    "all": _flag,
    "include": _patterns,
    "exclude": _patterns,
    "namespace1": _name,
    "namespace2": _name,
    "rename": _mapping(_name, _name),
    "parameters": _flag,
}
SECTIONS = ("topics", "services", "actions", "discover", "types")


def load_config(paths: Iterable[Path], selection: Selection | None = None) -> BridgeConfig:
    """Read one or several files as one configuration; ``selection`` (the command line's) is added to theirs.

    Raises:
        ConfigError: A file can't be read, a key or value is wrong, or routes meet each other.
    """
    configs = [read_config(path) for path in paths]
    merged = BridgeConfig(
        tuple(route for config in configs for route in config.topics),
        tuple(route for config in configs for route in config.services),
        tuple(route for config in configs for route in config.actions),
        merge_selections([*(config.selection for config in configs), *([selection] if selection is not None else [])]),
        merge_rules(config.rules for config in configs),
    )
    _require_apart(merged)
    return merged


def merge_rules(rules: Iterable[TypeRules]) -> TypeRules:
    """Return the rules of all."""
    rules = list(rules)
    packages = {ros1: ros2 for one in rules for ros1, ros2 in one.packages.items()}
    return TypeRules(packages, [rule for one in rules for rule in one.own])


def merge_selections(selections: Iterable[Selection]) -> Selection:
    """Return all patterns and renamings together; raises ConfigError when two name a namespace differently."""
    selections = list(selections)
    namespaces = {}
    for key in ("namespace1", "namespace2"):
        told = sorted({getattr(selection, key) for selection in selections} - {""})
        if len(told) > 1:
            raise ConfigError(f"{key}: given as {' and as '.join(told)}; keep one")
        namespaces[key] = told[0] if told else ""
    return Selection(
        include=tuple(pattern for selection in selections for pattern in selection.include),
        exclude=tuple(pattern for selection in selections for pattern in selection.exclude),
        renames=tuple(pair for selection in selections for pair in selection.renames),
        parameters=all(selection.parameters for selection in selections),
        **namespaces,
    )


def read_config(path: Path) -> BridgeConfig:
    """Read one file; raises ConfigError."""
    root = read_yaml(path, ConfigError)
    sections = root.record("the configuration", SECTIONS) if root is not None else {}
    return BridgeConfig(
        tuple(_route(TopicRoute, item, TOPIC_KEYS, "direction") for item in _items(sections, "topics")),
        tuple(_route(ServiceRoute, item, SERVICE_KEYS, "server") for item in _items(sections, "services")),
        tuple(_route(ActionRoute, item, SERVICE_KEYS, "server") for item in _items(sections, "actions")),
        _selection(_entry(sections["discover"], "'discover'", DISCOVER_KEYS)) if "discover" in sections else Selection(),
        _rules(sections["types"]) if "types" in sections else TypeRules(),
    )


def _selection(values: dict[str, Any]) -> Selection:
    include = (*values.pop("include", ()), *(("*",) if values.pop("all", False) else ()))
    return Selection(include=include, renames=tuple(values.pop("rename", {}).items()), **values)


def _rules(types: Located) -> TypeRules:
    parts = types.record("'types'", ("packages", "messages", "services"))
    packages = _value(parts["packages"], "packages", _mapping(_package, _package)) if "packages" in parts else {}
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


def _route(kind: type[Route], item: Located, readers: Mapping[str, Reader], way: str) -> Route:
    values = _entry(item, "a route", readers)
    name = values.pop("name", None)
    if name is None and not {"ros1_name", "ros2_name"} <= values.keys():
        raise item.wrong("no name; give 'name', or 'ros1_name' and 'ros2_name'")
    for key in (way, "type"):
        if key not in values:
            raise item.wrong(f"'{key}' is missing for {name or values['ros1_name']}")
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
