"""The fields of ROS messages, from their `.msg` files: of the robot's packages, of what lies below them, and of a ROS that is sourced."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from alula.common.robots import RobotFolder
from alula.common.suggestions import nearest, quoted
from alula.language.lexer import MAX_CHARACTERS
from alula.language.side_files import load_types
from alula.model.ros_types import PRIMITIVES, RosType, parse_type

Fields = Mapping[str, RosType | None]
"""By name; None: of a type that models do not have, such as a list of a certain length."""
_FIELD = re.compile(r"(?P<type>[\w/]+)(?P<bound><=\d+)?(?P<array>\[[<=\d]*\])?\s+(?P<name>[a-zA-Z]\w*)\s*(?P<constant>=)?.*")
_HEADER = "Header"
"""ROS 1 has it without its package."""


class FieldError(Exception):
    """There is no such field; ``cure`` may be empty."""

    def __init__(self, message: str, cure: str = "") -> None:
        super().__init__(message)
        self.cure = cure


class Messages:
    """The messages that the models of a robot can use."""

    def __init__(self, types: Mapping[str, RosType], folders: Iterable[Path] = ()) -> None:
        self._types = {**{name: RosType("", name) for name in PRIMITIVES}, **types}
        self._folders = tuple(folders)
        self._read: dict[RosType, Fields | None] = {}

    def field(self, type_name: str, path: Sequence[str]) -> RosType | None:
        """Return the type at the end of a path of fields that begins at a type of the models; None where a message on it is not known."""
        type_ = self._types.get(type_name)
        for name in path:
            if type_ is None:
                return None
            if type_.array or not type_.package:
                raise FieldError(f"{type_.interface} has no fields")
            fields = self._fields(type_)
            if fields is None:
                return None
            if name not in fields:
                raise FieldError(f"{type_.interface} has no field `{name}`", nearest(name, fields) or f"it has {quoted(list(fields))}")
            type_ = fields[name]
        return type_

    def inside(self, type_name: str, path: Sequence[str]) -> Fields:
        """Return the fields of the message at the end of a path of fields; empty where it has none, or is not known."""
        try:
            type_ = self.field(type_name, path)
        except FieldError:
            return {}
        return self._fields(type_) or {} if type_ is not None and type_.package and not type_.array else {}

    def _fields(self, message: RosType) -> Fields | None:
        if message not in self._read:
            self._read[message] = self._definition(message)
        return self._read[message]

    def _definition(self, message: RosType) -> Fields | None:
        for folder in self._folders:
            path = folder / message.package / "msg" / f"{message.name}.msg"
            try:
                if path.stat().st_size <= MAX_CHARACTERS:
                    return fields_of(path.read_text(encoding="utf-8", errors="replace"), message.package)
            except OSError:
                continue
        return None


NO_MESSAGES = Messages({})


def fields_of(definition: str, package: str) -> Fields:
    """Return the fields of a message from the text of its definition; ``package`` is the package of the definition."""
    fields: dict[str, RosType | None] = {}
    for line in definition.splitlines():
        match = _FIELD.fullmatch(line.partition("#")[0].strip())
        if match is not None and not match["constant"]:
            fields[match["name"]] = _type(match["type"], match["array"], package)
    return fields


def _type(name: str, array: str | None, package: str) -> RosType | None:
    if name == _HEADER:
        name = f"std_msgs/{_HEADER}"
    local = name if "/" in name or name in PRIMITIVES else f"{package}/{name}"
    return parse_type(local + (array or ""))


def messages_of(robot: RobotFolder) -> Messages:
    """Return the messages that a robot's models use."""
    types, _ = load_types(robot.skillsets / "types.yaml")
    worlds = (robot.ros2, robot.ros1)
    below = [underlay / "share" for world in worlds for underlay in world.underlays]
    sourced = [Path(prefix) / "share" for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    return Messages(types, [*(folder for world in worlds for folder in world.packages), *below, *sourced])
