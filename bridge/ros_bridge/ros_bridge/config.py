"""The configuration as values: routes, the selection of discovery, rules for types. ``config_file`` reads them from files."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar

from ros_bridge.mapping import TypeRules
from ros_bridge.selection import Selection


class Direction(Enum):
    """The direction of a topic."""

    ROS1_TO_ROS2 = "ros1_to_ros2"
    ROS2_TO_ROS1 = "ros2_to_ros1"


class RosVersion(Enum):
    """One of the two worlds; of a service, the one that its server lives in."""

    ROS1 = "ros1"
    ROS2 = "ros2"


class Reliability(Enum):
    """What the ROS 2 end of a topic offers or asks for."""

    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"


@dataclass(frozen=True)
class TopicRoute:
    """A topic that crosses. ``latched`` is ROS 1's latch and ROS 2's transient local; ``depth`` bounds every queue on the way.

    ``type_name`` is ROS 1's type, ``ros2_type`` ROS 2's (both ``package/Name``), empty where the mapping rules tell it. ``md5sum`` is that
    of the definition that a node in ROS 1 has said it has; empty where none has been asked.
    """

    ros1_name: str
    ros2_name: str
    direction: Direction
    type_name: str
    latched: bool = False
    depth: int = 10
    reliability: Reliability = Reliability.RELIABLE
    ros2_type: str = ""
    md5sum: str = ""

    @property
    def label(self) -> str:
        """Name the route for people."""
        return f"topic {_both_names(self)}"

    @property
    def target_name(self) -> str:
        """The name in the world that the messages go to; no two routes share it."""
        return self.ros2_name if self.direction is Direction.ROS1_TO_ROS2 else self.ros1_name


@dataclass(frozen=True)
class _ServedRoute:
    """A service or action: a server in one world, and callers in the other; ``md5sum`` as of a topic, for an action of all parts."""

    KIND: ClassVar[str]

    ros1_name: str
    ros2_name: str
    server: RosVersion
    type_name: str
    timeout_s: float = 5.0
    ros2_type: str = ""
    md5sum: str = ""

    @property
    def label(self) -> str:
        """Name the route for people."""
        return f"{self.KIND} {_both_names(self)}"

    @property
    def target_name(self) -> str:
        """The name in the world that the callers are in."""
        return self.ros2_name if self.server is RosVersion.ROS1 else self.ros1_name


@dataclass(frozen=True)
class ServiceRoute(_ServedRoute):
    """A service that crosses; ``timeout_s`` (wall clock) bounds a call with all its waiting."""

    KIND = "service"


@dataclass(frozen=True)
class ActionRoute(_ServedRoute):
    """An action that crosses: actionlib in ROS 1, an action in ROS 2.

    ``type_name`` is ``package/Name``, as ROS 2 has it: ROS 1's messages are ``package/NameAction``, ``package/NameGoal`` and so on.
    ``timeout_s`` (wall clock) bounds each waiting for the server's acknowledgement, not the goal's execution.
    """

    KIND = "action"


Spec = TopicRoute | ServiceRoute | ActionRoute


def _both_names(spec: TopicRoute | _ServedRoute) -> str:
    return spec.ros1_name if spec.ros1_name == spec.ros2_name else f"{spec.ros1_name} (ROS 2: {spec.ros2_name})"


@dataclass(frozen=True)
class BridgeConfig:
    """Named routes, and what discovery selects besides."""

    topics: tuple[TopicRoute, ...] = ()
    services: tuple[ServiceRoute, ...] = ()
    actions: tuple[ActionRoute, ...] = ()
    selection: Selection = field(default_factory=Selection)
    rules: TypeRules = field(default_factory=TypeRules)

    @property
    def routes(self) -> tuple[Spec, ...]:
        """The routes that the file names: topics, services, actions."""
        return (*self.topics, *self.services, *self.actions)
