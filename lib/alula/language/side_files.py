"""Reads `types.yaml` and `bindings.yaml`, which stand beside a robot's models; an unknown key is an error."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TypeVar

import yaml

from alula.common.suggestions import nearest, quoted
from alula.language.errors import Diagnostic
from alula.language.lexer import MAX_CHARACTERS
from alula.language.robot import Bindings, BridgedAction, BridgedService, BridgedTopic, DataSource
from alula.language.standard_messages import standard_messages
from alula.model.ros_types import PRIMITIVES, RosType, parse_type
from alula.model.span import Span

T = TypeVar("T", DataSource, BridgedTopic, BridgedService, BridgedAction)


def load_types(path: Path) -> tuple[dict[str, RosType], list[Diagnostic]]:
    """Read `Name: ros/Type` lines; ROS primitives stand for themselves and needn't be in the file."""
    findings: list[Diagnostic] = []
    types: dict[str, RosType] = {name: RosType("", name) for name in PRIMITIVES}
    for name, text in _mapping(path, findings).items():
        ros = parse_type(text) if isinstance(text, str) else None
        if ros is None:
            findings.append(_wrong(path, f"type `{name}` is {text!r}; it should be a ROS type such as float64 or geometry_msgs/Point"))
            continue
        types[str(name)] = ros
        if not _may_be(ros):
            hint = nearest(ros.name, standard_messages()[ros.package])
            findings.append(_wrong(path, f"type `{name}` is {text}, and {ros.package} has no message `{ros.name}`", hint))
    return types, findings


def _may_be(ros: RosType) -> bool:
    """Return whether there may be such a message: of the packages that each ROS brings along it is known, or sourced there."""
    if ros.name in standard_messages().get(ros.package, {ros.name}):
        return True
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    return any((Path(prefix) / "share" / ros.package / "msg" / f"{ros.name}.msg").is_file() for prefix in prefixes)


def load_bindings(path: Path) -> tuple[Bindings, list[Diagnostic]]:
    """Read the sections `data`, `topics`, `services` and `actions`."""
    findings: list[Diagnostic] = []
    document = _mapping(path, findings)
    for key in document:
        if key not in _SECTIONS:
            hint = nearest(str(key), _SECTIONS)
            findings.append(_wrong(path, f"unknown section `{key}`; there are {quoted(_SECTIONS)}", hint))
    data: dict[tuple[str, str], DataSource] = {}
    section = document.get("data") or {}
    if not isinstance(section, Mapping):
        findings.append(_wrong(path, "`data` should map `skillset.data` to {topic: /name}"))
        section = {}
    for name, entry in section.items():
        skillset, _, member = str(name).partition(".")
        source = _record(path, f"data.{name}", {"topic": entry} if isinstance(entry, str) else entry, DataSource, findings)
        if source is not None:
            data[skillset, member] = source
    topics = _records(path, "topics", document.get("topics"), BridgedTopic, findings)
    services = _records(path, "services", document.get("services"), BridgedService, findings)
    actions = _records(path, "actions", document.get("actions"), BridgedAction, findings)
    return Bindings(data, tuple(topics), tuple(services), tuple(actions)), findings


_SECTIONS = ("data", "topics", "services", "actions")

_CHECKS: Mapping[str, tuple[str, Callable[[object], bool]]] = {
    "name": ("an absolute ROS name such as /zed/depth", lambda v: isinstance(v, str) and v.startswith("/")),
    "topic": ("an absolute ROS name such as /zed/depth", lambda v: isinstance(v, str) and v.startswith("/")),
    "ros1_name": ("an absolute ROS name", lambda v: isinstance(v, str) and v.startswith("/")),
    "ros2_name": ("an absolute ROS name", lambda v: isinstance(v, str) and v.startswith("/")),
    "type": ("package/Name", lambda v: isinstance(v, str) and v.count("/") == 1 and parse_type(v) is not None),
    "ros2_type": ("package/Name", lambda v: isinstance(v, str) and v.count("/") == 1 and parse_type(v) is not None),
    "reliability": ("reliable or best_effort", lambda v: v in {"reliable", "best_effort"}),
    "direction": ("ros1_to_ros2 or ros2_to_ros1", lambda v: v in {"ros1_to_ros2", "ros2_to_ros1"}),
    "server": ("ros1 or ros2", lambda v: v in {"ros1", "ros2"}),
    "latched": ("true or false", lambda v: isinstance(v, bool)),
    "depth": ("a whole number from 1 on", lambda v: type(v) is int and v >= 1),
    "timeout_s": ("a positive number of seconds", lambda v: type(v) in {int, float} and v > 0),  # type: ignore[operator]
}


def _records(path: Path, section: str, entries: object, cls: type[T], findings: list[Diagnostic]) -> list[T]:
    if entries is None:
        return []
    if not isinstance(entries, list):
        findings.append(_wrong(path, f"`{section}` should be a list"))
        return []
    records = [_record(path, f"{section}[{index}]", entry, cls, findings) for index, entry in enumerate(entries)]
    return [record for record in records if record is not None]


def _record(path: Path, where: str, entry: object, cls: type[T], findings: list[Diagnostic]) -> T | None:
    """Return one entry as a value of ``cls``, or None after having reported why it is none."""
    if not isinstance(entry, Mapping):
        findings.append(_wrong(path, f"{where} should be a mapping, not {entry!r}"))
        return None
    declared = {f.name: f for f in fields(cls)}
    before = len(findings)
    for key, value in entry.items():
        if key not in declared:
            findings.append(_wrong(path, f"{where} has an unknown key `{key}`", nearest(str(key), declared)))
        elif not _is_good(str(key), value):
            findings.append(_wrong(path, f"{where}: `{key}` is {value!r}; it should be {_CHECKS[str(key)][0]}"))
    for name, one in declared.items():
        if one.default is MISSING and name not in entry:
            findings.append(_wrong(path, f"{where} has no `{name}`"))
    return cls(**entry) if len(findings) == before else None


def _is_good(key: str, value: object) -> bool:
    try:
        return _CHECKS[key][1](value)
    except TypeError:  # not hashable: a list where a word should be
        return False


def _mapping(path: Path, findings: list[Diagnostic]) -> Mapping[object, object]:
    """Return the file's top level; empty where the file is missing, empty or (reported) not a mapping."""
    if not path.exists():
        return {}
    try:
        if path.stat().st_size > MAX_CHARACTERS:
            findings.append(_wrong(path, f"{path.stat().st_size} bytes are too much"))
            return {}
        document = yaml.safe_load(path.read_bytes())
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        findings.append(_wrong(path, f"can't be read: {' '.join(str(error).split())[:300]}"))
        return {}
    if document is None:
        return {}
    if not isinstance(document, Mapping):
        findings.append(_wrong(path, "the file should be a mapping at its top"))
        return {}
    return document


def _wrong(path: Path, message: str, hint: str = "") -> Diagnostic:
    return Diagnostic("ALU005", message, Span(str(path), 0, 0, 0), hint=hint)
