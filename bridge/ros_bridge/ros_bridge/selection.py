"""Which names are bridged by discovery, and what each is called in the other world.

The two worlds' names are paired one to one: a name whose way back leads to another name is not bridged, so that no message can go
round through a chain of renamed topics.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

# What every node has in its own world, and what would only tell a world about the other's plumbing; an include of the very name wins.
NEVER = (
    "/rosout",
    "/rosout_agg",
    "/parameter_events",
    "*/ros_bridge/*",
    "*/ros1_parameters/*",
    "*/_action/*",
    "*/get_loggers",
    "*/set_logger_level",
    "*/describe_parameters",
    "*/get_parameter_types",
    "*/get_parameters",
    "*/list_parameters",
    "*/set_parameters",
    "*/set_parameters_atomically",
    "*/get_type_description",
)

ROS1_NAME = re.compile(r"(/[A-Za-z0-9_]+)+")
ROS2_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def is_ros1_name(name: str) -> bool:
    """Return whether ROS 1 can have an absolute name."""
    return ROS1_NAME.fullmatch(name) is not None


def is_ros2_name(name: str) -> bool:
    """Return whether ROS 2 can have an absolute name: no part of it begins with a digit."""
    return ROS2_NAME.fullmatch(name) is not None


@dataclass(frozen=True)
class Selection:
    """Patterns (``*`` and ``?`` match slashes, too; either world's name may match) and renaming.

    ``namespace2``: where ROS 1's names lie in ROS 2; ``namespace1``: where ROS 2's lie in ROS 1. ``renames`` are pairs of a ROS 1 and a
    ROS 2 name, each for the name itself and all names below it. ``parameters``: whether ROS 1's are shown in ROS 2, too.
    """

    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    namespace1: str = ""
    namespace2: str = ""
    renames: tuple[tuple[str, str], ...] = ()
    parameters: bool = True

    def selects(self, ros1_name: str, ros2_name: str) -> bool:
        """Return whether a pair of names is to be bridged."""
        names = (ros1_name, ros2_name)
        if not _matches(names, self.include) or _matches(names, self.exclude):
            return False
        return not _matches(names, NEVER) or any(name in self.include for name in names)

    def to_ros2(self, ros1_name: str) -> str | None:
        """Return the ROS 2 name of a ROS 1 name; None when it has none of its own."""
        name = self._forth(ros1_name)
        return name if self._back(name) == ros1_name else None

    def to_ros1(self, ros2_name: str) -> str | None:
        """Return the ROS 1 name of a ROS 2 name; None when it has none of its own."""
        name = self._back(ros2_name)
        return name if self._forth(name) == ros2_name else None

    def _forth(self, name: str) -> str:
        return _renamed(name, self.renames) or _moved(name, self.namespace1, self.namespace2)

    def _back(self, name: str) -> str:
        return _renamed(name, [(ros2, ros1) for ros1, ros2 in self.renames]) or _moved(name, self.namespace2, self.namespace1)


def _matches(names: Sequence[str], patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(name, pattern) for name in names for pattern in patterns)


def _renamed(name: str, renames: Sequence[tuple[str, str]]) -> str | None:
    for old, new in renames:
        if name == old or name.startswith(f"{old}/"):
            return new + name[len(old) :]
    return None


def _moved(name: str, out_of: str, into: str) -> str:
    """Take a name out of the namespace that the other world's names lie in, or else put it into the one for this world's names."""
    return name[len(out_of) :] if out_of and name.startswith(f"{out_of}/") else into + name
