"""Read the configuration from YAML, with errors that name file, line, key and remedy."""

from __future__ import annotations

import graphlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import yaml

from ros_bridge.config import ActionRoute, BridgeConfig, Direction, Reliability, ServiceRoute, TopicRoute, World
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
SERVICE_KEYS: Mapping[str, Reader] = {**NAMES, "server": _choice(World), "type": _type, "ros2_type": _type, "timeout_s": _timeout}
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
SECTIONS: Mapping[str, Mapping[str, Reader]] = {"topics": TOPIC_KEYS, "services": SERVICE_KEYS, "actions": SERVICE_KEYS}


def load_config(paths: Iterable[Path], selection: Selection | None = None) -> BridgeConfig:
    """Read one or several files as one configuration; ``selection`` (the command line's) is added to theirs.

    Raises:
        ConfigError: A file can't be read, a key or value is wrong, or routes meet each other.
    """
    configs = [parse_config(_read(path), str(path)) for path in paths]
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
    selection, rules = Selection(), TypeRules()
    for section, node, line in _pairs(root, file) if root is not None else ():
        if section == "discover":
            selection = _selection(_entry(node, DISCOVER_KEYS, file))
        elif section == "types":
            rules = _rules(node, file)
        elif section in SECTIONS:
            entries[section] = [
                (item.start_mark.line + 1, _entry(item, SECTIONS[section], file)) for item in _items(section, node, line, file)
            ]
        else:
            raise ConfigError(f"{file}:{line}: unknown key '{section}'; known are {', '.join(SECTIONS)}, discover, types")
    return BridgeConfig(
        tuple(_route(TopicRoute, values, ("direction", "type"), f"{file}:{line}") for line, values in entries["topics"]),
        tuple(_route(ServiceRoute, values, ("server", "type"), f"{file}:{line}") for line, values in entries["services"]),
        tuple(_route(ActionRoute, values, ("server", "type"), f"{file}:{line}") for line, values in entries["actions"]),
        selection,
        rules,
    )


def _selection(values: dict[str, Any]) -> Selection:
    include = (*values.pop("include", ()), *(("*",) if values.pop("all", False) else ()))
    return Selection(include=include, renames=tuple(values.pop("rename", {}).items()), **values)


def _rules(node: yaml.Node, file: str) -> TypeRules:
    packages: dict[str, str] = {}
    rules = []
    for key, part, line in _pairs(node, file):
        if key == "packages":
            packages = _value(part, _mapping(_package, _package), f"{file}:{line}: packages")
        elif key in {"messages", "services"}:
            for item in _items(key, part, line, file):
                values = _entry(item, RULE_KEYS, file)
                if not {"ros1", "ros2"} <= values.keys():
                    raise ConfigError(f"{file}:{item.start_mark.line + 1}: a rule needs 'ros1' and 'ros2', each a type")
                rules.append(TypeRule(**values))
        else:
            raise ConfigError(f"{file}:{line}: unknown key '{key}'; known are packages, messages, services")
    return TypeRules(packages, rules)


def _items(section: str, node: yaml.Node, line: int, file: str) -> Iterator[yaml.Node]:
    if not isinstance(node, yaml.SequenceNode):
        raise ConfigError(f"{file}:{line}: '{section}' has to be a list of entries")
    yield from node.value


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
        values[key] = _value(value_node, readers[key], f"{file}:{line}: {key}")
    return values


def _value(node: yaml.Node, reader: Reader, place: str) -> Any:
    value = yaml.SafeLoader("").construct_object(node, deep=True)
    try:
        return reader(value)
    except ValueError as expected:
        raise ConfigError(f"{place}: {value!r} is not {expected}") from None


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
