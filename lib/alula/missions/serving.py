"""Run without a mission: serve the robot's skills to any client until the run is ended."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running, Success

from alula.common.scenarios import Scenario
from alula.missions.conditions import Condition, answers
from alula.missions.context import MissionContext
from alula.missions.pending import PendingInterrupts
from alula.missions.plan import MissionPlan
from alula.missions.skillset import Client, Clock


class Serving:
    """Stand in for a mission: wait until all skillsets are up, then decide nothing."""

    degraded = False
    stopping = False

    def __init__(self, clients: Mapping[str, Client]) -> None:
        self._clients = clients
        self.root: Behaviour = Running("serve")

    def conditions(self) -> list[Condition]:
        """Return that the skillsets answer, met or not."""
        return answers(self._clients)

    def stop_here(self) -> Behaviour:
        """Add nothing: the run brings the robot to rest."""
        return Success("stop_here")


def serving_plan(scenario: Scenario) -> MissionPlan:
    """Return the plan of a scenario that has no mission."""

    def make(clients: Mapping[str, Client], clock_ns: Clock, _values: Mapping[str, float]) -> tuple[Serving, MissionContext]:
        return Serving(clients), MissionContext(clock_ns=clock_ns, pending=PendingInterrupts(clock_ns))

    return MissionPlan(scenario.name, scenario.skillsets, make, serves=True)
