"""`python -m console_bench FOLDER`: a real mission's process, ticked as any other; its record goes to the folder."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running, Success

from alula.missions.blackboard import Blackboard
from alula.missions.conditions import Condition
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import MissionPlan
from alula.missions.skillset import Client, Clock
from skillset_ros2.mission_node import run_mission


class Endless:
    """A tree whose only leaf runs for ever."""

    degraded = False
    stopping = False

    def __init__(self) -> None:
        self.root: Behaviour = Running("for ever")

    def conditions(self) -> list[Condition]:
        """Return what the mission needs to start: nothing."""
        return []

    def stop_here(self) -> Behaviour:
        """Make a tree that brings nothing to rest."""
        return Success("at rest")


def make(_skillsets: Mapping[str, Client], clock_ns: Clock, _parameters: Mapping[str, float]) -> tuple[Endless, Blackboard]:
    """Make the mission and its blackboard."""
    return Endless(), Blackboard(clock_ns=clock_ns, pending=PendingInterrupts(clock_ns))


if __name__ == "__main__":
    sys.exit(run_mission(MissionPlan("bench", (), make), Path(sys.argv[1]), [sys.argv[0]]))
