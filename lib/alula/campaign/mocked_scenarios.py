"""Runs of a scenario over mocks, many in one process: what does not change between them is read once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from alula.campaign.flown import FlownResponse, Ticks
from alula.common.faults import FaultError, FaultRequest
from alula.common.robots import RobotError, find_robot
from alula.common.scenarios import Scenario, ScenarioError, load_scenario
from alula.missions.director import MissionResult
from alula.missions.mocked import MockedMission, check_faults
from alula.missions.plan import InputError, Inputs, MissionPlan
from alula.missions.scenario import check_names, inputs_of, plan_of
from alula.mock import Behaviour
from alula.model.model import Skillset
from alula.records.errors import AnalysisError
from alula.records.mocks import behaviour_of
from alula.records.models import robot_skillsets
from alula.records.tree import Places, tip_of
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import EngineEvent
from alula.trees.node import Node


@dataclass(frozen=True)
class MockedRun:
    """A run over mocks: what happened, how it ended, what went wrong in the mocks themselves, and what is open."""

    events: Sequence[EngineEvent]
    end: MissionResult
    notes: Sequence[str]
    open: Sequence[str]
    faults: dict[str, float] = field(default_factory=dict)
    """When each fault came, seconds of mission clock; those that came to nothing are missing."""
    places: Places = field(default_factory=Places)
    """Where in the tree its executions were started."""
    responses: Sequence[FlownResponse] = ()
    """What its tree did about each failure that it saw."""


@dataclass(frozen=True)
class MockedScenario:
    """A scenario, ready to be run."""

    scenario: Scenario
    skillsets: tuple[Skillset, ...]
    behaviour: Behaviour
    inputs: Inputs

    @cached_property
    def plan(self) -> MissionPlan:
        """The mission, read once for all runs; raises RobotError and InputError."""
        return plan_of(self.scenario, self.inputs, self.skillsets)

    def check(self, faults: Sequence[FaultRequest]) -> None:
        """Refuse faults that the mocks don't have.

        Raises:
            AnalysisError: there is none of this name.
        """
        try:
            check_faults(faults, self.behaviour, self.scenario.skillsets, dict(self.scenario.faults))
        except (FaultError, SkillRuntimeError) as error:
            raise AnalysisError(str(error)) from None

    def run(self, faults: Sequence[FaultRequest] = (), seed: int = 0) -> MockedRun:
        """Run the mission once over mocks, in virtual time; the same faults and seed give the same run."""
        ticks = Ticks()
        mission = MockedMission(self.skillsets, self.behaviour, self.plan, faults=faults, seed=seed, listener=ticks)
        if isinstance(mission.director.root, Node):
            ticks.watch(mission.director.root)
        end = mission.run()
        places = Places(mission.places, tip_of(mission.director.view().as_dict()))
        responses = ticks.responses(mission.places)
        return MockedRun(mission.events, end, mission.notes, mission.open_executions, mission.faults, places, responses)


def load_mocked_scenario(name: str, behaviour: Sequence[Path] = (), *, world: str = "", inputs: Inputs | None = None) -> MockedScenario:
    """Read what runs of a scenario over mocks need: the robot's own mocks, with behaviour files on top of them.

    ``inputs``: of the mission, where they are not to be read from the world.

    Raises:
        AnalysisError: a file is missing or wrong, with its place.
    """
    try:
        scenario, robot = load_scenario(name), find_robot()
        if not scenario.mission:
            raise AnalysisError(f"the scenario {name} has no mission to be run over mocks; `alula mock` serves its skills")
        check_names(scenario, robot_skillsets())
        given = inputs_of(scenario, world) if inputs is None else inputs
        known = behaviour_of(robot, behaviour).of(frozenset(scenario.skillsets))
    except (ScenarioError, RobotError, InputError, SkillRuntimeError) as error:
        raise AnalysisError(str(error)) from None
    return MockedScenario(scenario, tuple(robot_skillsets(scenario.skillsets)), known, given)
