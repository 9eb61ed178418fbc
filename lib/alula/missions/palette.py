"""All types of node that a robot's missions may be made of: to tick, to check, to draw, for editors."""

from __future__ import annotations

from collections.abc import Sequence

from alula.missions.blackboard import Blackboard
from alula.missions.nodes import mission_nodes
from alula.missions.part import MissionPart
from alula.missions.pending import PendingInterrupts
from alula.missions.skills import Crew, robot_nodes
from alula.model.model import Skillset
from alula.trees.palette import Palette
from alula.trees.standard import standard_palette


def mission_palette(skillsets: Sequence[Skillset], part: MissionPart, crew: Crew | None = None) -> Palette:
    """Return BehaviorTree.CPP's nodes, Alula's, the robot's own, its skills and resources; without a crew the last can't be ticked."""
    memory = Blackboard(clock_ns=int, pending=PendingInterrupts(int)) if crew is None else crew.memory
    palette = standard_palette() | mission_nodes(memory) | robot_nodes(skillsets, crew)
    for node in part.nodes:
        palette.register(node)
    return palette
