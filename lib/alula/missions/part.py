"""What a robot adds to missions that are files: its part ``missions``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from alula.common.public import public
from alula.missions.context import MissionContext
from alula.missions.plan import Inputs
from alula.trees.node import Node


@public("alula.parts")
@dataclass(frozen=True)
class MissionPart:
    """What a robot adds to missions: nodes, by the names of `alula.trees.register`, and the context of its missions.

    ``check_inputs`` raises InputError for inputs that the robot's missions can't use: before the run, not in the middle of it.
    """

    nodes: tuple[type[Node], ...] = ()
    context: type[MissionContext] = MissionContext
    check_inputs: Callable[[Inputs], object] = dict


NO_PART = MissionPart()
"""That of a robot that adds nothing."""
