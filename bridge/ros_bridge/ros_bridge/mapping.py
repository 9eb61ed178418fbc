"""Rules that tell which type of one world is which of the other where names differ, and which field is which.

Without a rule a type has the same ``package/Name`` in both worlds. Rules come from the configuration's ``types`` section; these are
built in: tf's message moved to tf2_msgs, ROS 2 has a log message of its own, and times, durations and UUIDs are in other packages.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class TypeRule:
    """One type of ROS 1 is one of ROS 2. ``fields`` maps paths with dots, from ROS 1's names to ROS 2's; others go by their names.

    ``complete``: ``fields`` has all pairs that there are, and fields that are not in it do not cross.
    """

    ros1: str
    ros2: str
    fields: Mapping[str, str] = field(default_factory=dict, hash=False)
    complete: bool = False


BUILT_IN = (
    TypeRule("tf/tfMessage", "tf2_msgs/TFMessage"),
    TypeRule("tf2_msgs/TFMessage", "tf2_msgs/TFMessage"),
    TypeRule("rosgraph_msgs/Log", "rcl_interfaces/Log", {"header.stamp": "stamp", "header.frame_id": "", "header.seq": "", "topics": ""}),
    TypeRule("std_msgs/Time", "builtin_interfaces/Time", {"data.sec": "sec", "data.nanosec": "nanosec"}),
    TypeRule("std_msgs/Duration", "builtin_interfaces/Duration", {"data.sec": "sec", "data.nanosec": "nanosec"}),
    TypeRule("uuid_msgs/UniqueID", "unique_identifier_msgs/UUID"),
)


class TypeRules:
    """All rules; later ones of the configuration win over the built-in ones."""

    def __init__(self, packages: Mapping[str, str] | None = None, rules: Iterable[TypeRule] = ()) -> None:
        """``packages`` maps a ROS 1 package's name to the ROS 2 package that has its types under the same names."""
        self.packages = dict(packages or {})
        self.own = tuple(rules)
        self._packages_back = {ros2: ros1 for ros1, ros2 in self.packages.items()}
        self._rules = (*self.own, *BUILT_IN)

    def to_ros2(self, ros1_type: str) -> str:
        """Return the ROS 2 type that a ROS 1 type becomes."""
        told = next((rule.ros2 for rule in self._rules if rule.ros1 == ros1_type), None)
        return told or _in_package(ros1_type, self.packages)

    def to_ros1(self, ros2_type: str) -> str:
        """Return the ROS 1 type that a ROS 2 type becomes; of several that a rule names, the one with the same name, else the first."""
        told = [rule.ros1 for rule in self._rules if rule.ros2 == ros2_type]
        if told:
            return ros2_type if ros2_type in told else told[0]
        return _in_package(ros2_type, self._packages_back)

    def fields(self, ros1_type: str, ros2_type: str) -> Mapping[str, str]:
        """Return the fields that a rule maps between two types; a path that becomes the empty one is left out on purpose."""
        return next((rule.fields for rule in self._rules if (rule.ros1, rule.ros2) == (ros1_type, ros2_type)), {})

    def only_told(self, ros1_type: str, ros2_type: str) -> bool:
        """Return whether the fields that a rule maps between two types are all that cross."""
        return next((rule.complete for rule in self._rules if (rule.ros1, rule.ros2) == (ros1_type, ros2_type)), False)

    def related(self, ros1_type: str, ros2_type: str) -> bool:
        """Return whether the two are one type in the rules' eyes."""
        return self.to_ros2(ros1_type) == ros2_type or any((rule.ros1, rule.ros2) == (ros1_type, ros2_type) for rule in self._rules)


def _in_package(name: str, packages: Mapping[str, str]) -> str:
    package, short = name.split("/")
    return f"{packages.get(package, package)}/{short}"
