"""The options of discovery: one table for the section ``discover`` of a file and for the command line."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from ros_bridge import config_values
from ros_bridge.config_values import Reader
from ros_bridge.errors import ConfigError
from ros_bridge.selection import Selection


@dataclass(frozen=True)
class Option:
    """How a value is read, what it says, and what argparse is told; an option without ``argument`` is one of files only."""

    reader: Reader
    help: str
    argument: Mapping[str, Any] | None = None


PATTERNS = {"action": "append", "metavar": "PATTERN"}
NAME = {"metavar": "NAME"}
OPTIONS: Mapping[str, Option] = {
    "all": Option(config_values.flag, "bridge every topic, service and action that appears in either world", {"action": "store_true"}),
    "include": Option(config_values.patterns, "bridge names that match, such as '/camera/*'", PATTERNS),
    "exclude": Option(config_values.patterns, "leave out names that match in either world", PATTERNS),
    "namespace1": Option(config_values.name, "put ROS 2's names below this one in ROS 1", NAME),
    "namespace2": Option(config_values.name, "put ROS 1's names below this one in ROS 2", NAME),
    "rename": Option(
        config_values.mapping(config_values.ros1_name, config_values.name),
        "ROS 1's name: ROS 2's, with all names below; wins over the namespaces",
    ),
    "parameters": Option(config_values.flag, "bridge ROS 1's parameters, as `all` does"),
}
"""Each sets the field of ``Selection`` of its name; ``all`` and ``rename`` are made into fields by ``make_selection``."""
READERS: Mapping[str, Reader] = {key: option.reader for key, option in OPTIONS.items()}


def make_selection(values: dict[str, Any]) -> Selection:
    """Return the selection of values that were read, by their keys."""
    include = (*values.pop("include", ()), *(("*",) if values.pop("all", False) else ()))
    return Selection(include=include, renames=tuple(values.pop("rename", {}).items()), **values)


def merge_selections(selections: Iterable[Selection]) -> Selection:
    """Return all patterns and renamings together; raises ConfigError when two set another option differently."""
    selections = list(selections)
    merged: dict[str, Any] = {}
    for option in fields(Selection):
        given = [getattr(selection, option.name) for selection in selections]
        if isinstance(option.default, tuple):
            merged[option.name] = tuple(part for parts in given for part in parts)
            continue
        set_values = sorted({value for value in given if value != option.default})
        if len(set_values) > 1:
            raise ConfigError(f"{option.name}: given as {' and as '.join(map(str, set_values))}; keep one")
        merged[option.name] = set_values[0] if set_values else option.default
    return Selection(**merged)


def below(namespace: str, selection: Selection) -> Selection:
    """Return a selection whose ROS 1 names lie in a namespace of ROS 2."""
    return replace(selection, namespace2=f"{namespace}{selection.namespace2}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command line."""
    for key, option in OPTIONS.items():
        if option.argument is not None:
            parser.add_argument(f"--{key}", help=option.help, default=None, **option.argument)


def read_arguments(options: argparse.Namespace) -> Selection:
    """Return what the command line selects; raises ConfigError for a value that is wrong."""
    given = {key: getattr(options, key, None) for key in OPTIONS}
    values: dict[str, Any] = {}
    for key, value in given.items():
        if value is not None:
            try:
                values[key] = READERS[key](value)
            except ValueError as expected:
                raise ConfigError(f"--{key}: {value!r} is not {expected}") from None
    return make_selection(values)
