"""Types and names as ROS has them, without ROS: primitives, messages, arrays, and what they are in Python."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from dataclasses import dataclass

PRIMITIVES: Mapping[str, str] = {
    "bool": "bool",
    "int8": "int",
    "int16": "int",
    "int32": "int",
    "int64": "int",
    "uint8": "int",
    "uint16": "int",
    "uint32": "int",
    "uint64": "int",
    "float32": "float",
    "float64": "float",
    "string": "str",
}
"""ROS primitives and the Python type that stands for each."""

INTEGER_RANGES: Mapping[str, tuple[int, int]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""The smallest and the largest value of each integer type."""

RESULT_FIELDS = ("outcome", "result", "message")
"""Fields of the result of every skill's action; the skill's outputs follow."""
FEEDBACK_FIELDS = ("progress", "state")
"""Fields of the feedback of every skill's action; the skill's outputs follow."""

_FIELD = re.compile(r"[a-z](?:_?[a-z0-9])*")
_TYPE = re.compile(r"(?:(?P<package>[a-z][a-z0-9_]*)/(?:msg/)?)?(?P<name>[A-Za-z][A-Za-z0-9]*)(?P<array>\[\])?")


@dataclass(frozen=True)
class RosType:
    """A primitive (``package`` empty) or a message; ``array`` is a list of it without bound."""

    package: str
    name: str
    array: bool = False

    @property
    def interface(self) -> str:
        """As an .action file names it: ``geometry_msgs/Point[]``. Also the ROS 1 form of a message."""
        element = f"{self.package}/{self.name}" if self.package else self.name
        return f"{element}[]" if self.array else element

    @property
    def ros2(self) -> str:
        """As ROS 2 tools name it: ``geometry_msgs/msg/Point``."""
        element = f"{self.package}/msg/{self.name}" if self.package else self.name
        return f"{element}[]" if self.array else element

    @property
    def python(self) -> str:
        """As an annotation: ``float``, ``geometry_msgs.msg.Point``, ``list[...]`` of it."""
        element = f"{self.package}.msg.{self.name}" if self.package else PRIMITIVES[self.name]
        return f"list[{element}]" if self.array else element

    @property
    def message(self) -> RosType | None:
        """The message that a topic carries values of this type in; None for an array, which no topic carries alone."""
        if self.array:
            return None
        return self if self.package else RosType("std_msgs", _WRAPPERS.get(self.name, self.name[:1].upper() + self.name[1:]))


_WRAPPERS: Mapping[str, str] = {"uint8": "UInt8", "uint16": "UInt16", "uint32": "UInt32", "uint64": "UInt64"}


def parse_type(text: str) -> RosType | None:
    """Return the type that a text such as ``float64``, ``geometry_msgs/Point`` or ``geometry_msgs/msg/Point[]`` names, if any."""
    match = _TYPE.fullmatch(text)
    if match is None or (match["package"] is None and match["name"] not in PRIMITIVES):
        return None
    return RosType(match["package"] or "", match["name"], match["array"] is not None)


def is_field_name(name: str) -> bool:
    """Return whether a field of an interface may have this name (rosidl's rule), and a Python variable too."""
    return bool(_FIELD.fullmatch(name)) and not keyword.iskeyword(name)


def is_package_name(name: str) -> bool:
    """Return whether a ROS package may have this name."""
    return bool(_FIELD.fullmatch(name))


def camel(name: str) -> str:
    """Return the name of a skill's action and classes: ``goto_straight`` is ``GotoStraight``."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))
