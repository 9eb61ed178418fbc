"""What a runner has to know of a mission to run it, over whatever middleware."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from alula.missions.blackboard import Blackboard
from alula.missions.director import Mission
from alula.missions.skillset import Client, Clock

MakeMission = Callable[[Mapping[str, Client], Clock, Mapping[str, float]], tuple[Mission, Blackboard]]
"""Makes the mission and its blackboard of the clients by skillset, the mission clock, and the parameters by name."""


def nothing_more() -> Mapping[str, object]:
    """Have nothing to add."""
    return {}


def hear_nothing(_node: object, _blackboard: Blackboard) -> None:
    """Listen to nothing beyond the skillsets."""


@dataclass(frozen=True)
class MissionPlan:
    """One mission.

    Attributes:
        scenario: its name, in the run's files.
        skillsets: what it calls.
        make: makes the tree.
        parameters: numbers that may be set from outside, with their defaults; on ROS 2 they are parameters of the node.
        departure: resource and state; the run's files count time from when this state is left first.
        facts: what ``mission.json`` says beyond the outcome, asked at the beginning and at the end.
        listen: on ROS 2, has the node listen to what says why a resource is as it is (``Blackboard.remarks``).
    """

    scenario: str
    skillsets: tuple[str, ...]
    make: MakeMission
    parameters: Mapping[str, float] = field(default_factory=dict)
    departure: tuple[str, str] | None = None
    facts: Callable[[], Mapping[str, object]] = nothing_more
    listen: Callable[[Any, Blackboard], None] = hear_nothing
