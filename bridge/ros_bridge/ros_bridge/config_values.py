"""Readers of the values that a configuration has: each returns its value typed, or raises ValueError with what it should have been."""

from __future__ import annotations

import re
from collections.abc import Callable
from enum import Enum

from ros_bridge.selection import is_ros1_name, is_ros2_name

TYPE = re.compile(r"[a-z][a-z0-9_]*/[A-Za-z][A-Za-z0-9_]*")
PACKAGE = re.compile(r"[a-z][a-z0-9_]*")
PATTERN = re.compile(r"[/*?\[][^\s]*")
FIELD = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[A-Za-z][A-Za-z0-9_]*)*")

Reader = Callable[[object], object]


def name(value: object) -> str:
    """Read an absolute name that both worlds can have."""
    if isinstance(value, str) and is_ros2_name(value):
        return value
    digit = "; no part begins with a digit, which only ROS 1 allows" if isinstance(value, str) and is_ros1_name(value) else ""
    raise ValueError(f"an absolute ROS name such as /camera/image{digit}")


def ros1_name(value: object) -> str:
    """Read an absolute name of ROS 1, whose parts may begin with a digit."""
    if isinstance(value, str) and is_ros1_name(value):
        return value
    raise ValueError("an absolute ROS name such as /camera/image")


def type_name(value: object) -> str:
    """Read a type ``package/Name``."""
    if isinstance(value, str) and TYPE.fullmatch(value):
        return value
    raise ValueError("a type in ROS 1's form, package/Name, such as std_msgs/String")


def package(value: object) -> str:
    """Return a package's name; raises ValueError that says what is expected."""
    if isinstance(value, str) and PACKAGE.fullmatch(value):
        return value
    raise ValueError("a package's name such as sensor_msgs")


def patterns(value: object) -> tuple[str, ...]:
    """Read a list of patterns of names."""
    if isinstance(value, list) and all(isinstance(item, str) and PATTERN.fullmatch(item) for item in value):
        return tuple(value)
    raise ValueError("a list of patterns such as [/camera/*, '*/odom']")


def field_path(value: object) -> str:
    """Read the path of a field; the empty one leaves a field out."""
    if isinstance(value, str) and (not value or FIELD.fullmatch(value)):
        return value
    raise ValueError("a field's name, with dots into its parts, such as header.stamp; '' leaves it out")


def mapping(key_reader: Reader, value_reader: Reader) -> Reader:
    """Return a reader of keys with values."""

    def read(value: object) -> dict[object, object]:
        if not isinstance(value, dict):
            raise ValueError("keys and values, such as {old: new}")  # noqa: TRY004 - as all readers do
        return {key_reader(key): value_reader(item) for key, item in value.items()}

    return read


def flag(value: object) -> bool:
    """Return true or false; raises ValueError that says what is expected."""
    if isinstance(value, bool):
        return value
    raise ValueError("true or false")


def depth(value: object) -> int:
    """Read the length of a queue."""
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 100_000:
        return value
    raise ValueError("a number of messages from 1 to 100000")


def timeout(value: object) -> float:
    """Return seconds above 0 and up to 3600; raises ValueError that says what is expected."""
    if isinstance(value, int | float) and not isinstance(value, bool) and 0 < value <= 3600:
        return float(value)
    raise ValueError("a number of seconds above 0 and up to 3600")


def choice(choices: type[Enum]) -> Reader:
    """Return a reader of the value of an enum."""

    def read(value: object) -> Enum:
        try:
            return choices(value)
        except ValueError:
            raise ValueError("one of " + ", ".join(choice.value for choice in choices)) from None

    return read
