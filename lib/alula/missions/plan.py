"""What a runner has to know of a mission to run it, over whatever middleware."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from alula.common.errors import AlulaError
from alula.common.public import public
from alula.missions.context import MissionContext
from alula.missions.director import Mission
from alula.missions.skillset import Client, Clock

Inputs = Mapping[str, Any]
"""What a mission is given, such as a route, by name; as JSON has it, because records keep it."""

MakeMission = Callable[[Mapping[str, Client], Clock, Mapping[str, float]], tuple[Mission, MissionContext]]
"""Makes the mission and its context of the clients by skillset, the mission clock, and the parameters by name."""


def nothing_more() -> Mapping[str, object]:
    """Return no facts: of a mission that adds none to its record."""
    return {}


@dataclass(frozen=True)
class MissionPlan:
    """One mission.

    Attributes:
        scenario: its name, in the run's files.
        skillsets: what it calls.
        make: makes the tree, a new one for each run: a plan may be run many times.
        parameters: numbers that may be set from outside, with their defaults; on ROS 2 they are parameters of the node.
        inputs: what it was made of.
        facts: what the mission's account says beyond the outcome, asked at the beginning and at the end.
        serves: it has no mission, and only serves its skills until it is told to end.
        places: of a fleet's, by skillset, the namespace of its robot and what it is called there, as ("/rover", "base").
    """

    scenario: str
    skillsets: tuple[str, ...]
    make: MakeMission
    parameters: Mapping[str, float] = field(default_factory=dict)
    inputs: Inputs = field(default_factory=dict)
    facts: Callable[[], Mapping[str, object]] = nothing_more
    serves: bool = False
    places: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def place(self, skillset: str) -> tuple[str, str]:
        """Return the namespace of a skillset's robot, empty for the mission's own, and the skillset's name there."""
        return self.places.get(skillset, ("", skillset))


@public("alula.parts")
class InputError(AlulaError):
    """The inputs of a mission can't be used; the message says what is wrong and where."""
