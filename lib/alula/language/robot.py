"""A robot: its skillsets, what their types are in ROS, and what of the functional layer they need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from alula.model.model import Data, Skillset
from alula.model.ros_types import PRIMITIVES, RosType

Direction = Literal["ros1_to_ros2", "ros2_to_ros1"]
World = Literal["ros1", "ros2"]
Reliability = Literal["", "reliable", "best_effort"]


@dataclass(frozen=True)
class BridgedTopic:
    """A topic that crosses the bridge, with the keys of a topic in the bridge's configuration; an empty value is not written there.

    ``type`` is in the ROS 1 form ``package/Name``, ``ros1_name`` and ``ros2_name`` rename it on a side.
    """

    name: str
    direction: Direction
    type: str
    latched: bool = False
    depth: int = 10
    ros1_name: str = ""
    ros2_name: str = ""
    ros2_type: str = ""
    reliability: Reliability = ""


@dataclass(frozen=True)
class _Served:
    """What is called across the bridge, with the keys that the bridge has for it; ``server`` is the ROS version of its server."""

    name: str
    server: World
    type: str
    timeout_s: float = 5.0
    ros1_name: str = ""
    ros2_name: str = ""
    ros2_type: str = ""


@dataclass(frozen=True)
class BridgedService(_Served):
    """A service that crosses the bridge, as ``BridgedTopic``."""


@dataclass(frozen=True)
class BridgedAction(_Served):
    """An action that crosses the bridge: actionlib's. ``type`` is ``package/Name``, as ROS 2 has it (``tf2_msgs/LookupTransform``)."""


@dataclass(frozen=True)
class DataSource:
    """Where a data's values come from: a topic of the functional layer."""

    topic: str
    latched: bool = False
    depth: int = 5


@dataclass(frozen=True)
class Bindings:
    """What lies under the skillsets: the source of each data, and what else must cross the bridge."""

    data: Mapping[tuple[str, str], DataSource] = field(default_factory=dict)
    topics: tuple[BridgedTopic, ...] = ()
    services: tuple[BridgedService, ...] = ()
    actions: tuple[BridgedAction, ...] = ()


@dataclass(frozen=True)
class Robot:
    """A folder of models. ``files`` gives each skillset's file relative to the folder above the robot's."""

    name: str
    skillsets: tuple[Skillset, ...]
    types: Mapping[str, RosType]
    bindings: Bindings
    files: Mapping[str, str] = field(default_factory=dict)

    def ros_type(self, name: str) -> RosType:
        """Return what a type of the models is in ROS; a loaded robot knows all that its skillsets use."""
        return self.types[name] if name in self.types else RosType("", name if name in PRIMITIVES else "")

    def message(self, data: Data) -> RosType:
        """Return the message that carries a data's values; a primitive is carried by its message of std_msgs."""
        ros = self.ros_type(data.type).message
        if ros is None:
            raise ValueError(f"no topic can carry data {data.name} of type {data.type}")
        return ros

    def source(self, skillset: Skillset, data: Data) -> DataSource:
        """Return where a data's values come from."""
        return self.bindings.data[skillset.name, data.name]
