"""Names and times of the skillset interface in ROS 1, defined once for managers and clients; the names are those of ROS 2."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import rospy

from alula.model.ros_types import camel
from alula.runtime.mission_clock import MissionClock

QUEUE = 2000
"""Messages that wait for a slow subscriber; more than the history of the events, which is sent in one go."""


@dataclass(frozen=True)
class ActionTypes:
    """The message classes of a skill's action."""

    spec: Any
    action_goal: Any
    action_result: Any
    action_feedback: Any
    goal: Any
    result: Any
    feedback: Any


def action_types(interfaces: ModuleType, skill: str) -> ActionTypes:
    """Return a skill's messages from ``<skillset>_interfaces`` or its ``msg`` module.

    Raises:
        AttributeError: they are not in it.
    """
    name = camel(skill)
    messages = interfaces if hasattr(interfaces, f"{name}Action") else importlib.import_module(f"{interfaces.__name__}.msg")
    if not hasattr(messages, f"{name}Action"):
        raise AttributeError(f"{interfaces.__name__} has no action {name} for skill {skill}; generate and build it again")
    kinds = ("Action", "ActionGoal", "ActionResult", "ActionFeedback", "Goal", "Result", "Feedback")
    return ActionTypes(*(getattr(messages, f"{name}{kind}") for kind in kinds))


def interfaces_of(skillset: str) -> ModuleType:
    """Import the messages of a skillset's actions; raise ModuleNotFoundError when they were not built."""
    return importlib.import_module(f"{skillset}_interfaces.msg")


def place(namespace: str, skillset: str) -> str:
    """Return the namespace of a skillset's names: ``/robot1/navigation``; without a namespace, below that of the process's node."""
    name: str = rospy.resolve_name(f"{namespace.rstrip('/')}/{skillset}" if namespace else skillset)
    return name


def mission_clock() -> MissionClock:
    """Make a mission clock of this process's node."""
    return MissionClock(lambda: not rospy.rostime.is_wallclock(), lambda: int(rospy.get_rostime().to_nsec()))
