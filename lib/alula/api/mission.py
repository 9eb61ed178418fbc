"""A mission as a program has it: read once, run over mocks as often as wanted, and asked for its odds."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.common.faults import MOCKED, FaultError, FaultRequest, changes_of, parse_fault, spans_of
from alula.common.public import public
from alula.common.robots import RobotFolder, find_robot, load_robot_folder, meaning
from alula.common.run_log import note_mocked
from alula.missions.driver import TICK_PERIOD_S
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import LATENCY_S, LIMIT_S, Listener, MockedMission, check_faults
from alula.missions.part import MissionPart
from alula.missions.plan import Inputs, MissionPlan
from alula.mock import Behaviour, load_behaviour
from alula.model.model import Skillset
from alula.odds.errors import OddsError
from alula.odds.odds import Odds
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.live.spec import FILE, RequestError, RunSpec
from alula.trees.library import Library
from alula.trees.node import Node
from alula.trees.source import TreeSource

Fault = str | FaultRequest
"""As on the command line, ``laser@20-30``, or as a value."""


@public()
@dataclass(frozen=True)
class Mission:
    """A mission with the models of its skills and with mocks for them; `load` makes it of a robot's scenario, `from_file` of a file.

    Attributes:
        plan: the mission itself, which makes a new tree for each run.
        skillsets: the models of the skillsets that it calls.
        behaviour: what their mocks do.
        path: its file.
        world: the file of the world that its inputs were read from, empty where there is none.
        robot: the robot that the mission belongs to, or None.
        ways: the ways in which each fault of its scenario can occur, by name; a fault that is not in it may have any.
    """

    plan: MissionPlan
    skillsets: tuple[Skillset, ...]
    behaviour: Behaviour
    path: Path
    world: str = ""
    robot: RobotFolder | None = None
    ways: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @classmethod
    def load(
        cls,
        scenario: str,
        robot: str | Path | None = None,
        *,
        world: str = "",
        behaviour: Sequence[str | Path] = (),
        inputs: Inputs | None = None,
    ) -> Mission:
        """Return the mission of a scenario.

        Args:
            scenario: its name.
            robot: the robot's folder; None: that of the current folder or above.
            world: name or file of another world than the scenario's.
            behaviour: files on top of what the robot's mocks do.
            inputs: of the mission; None: those that the robot reads from the world.

        Raises:
            AlulaError: there is no such robot or scenario, or one of its files is wrong.
        """
        folder = find_robot() if robot is None else load_robot_folder(Path(robot).resolve())
        with meaning(folder):
            known = load_mocked_scenario(scenario, list(map(Path, behaviour)), world=world, inputs=inputs)
            name = world or known.scenario.world
            place = str(folder.world(name).absolute()) if name else ""
            file, ways = folder.root / known.scenario.mission, dict(known.scenario.faults)
            return cls(known.plan, known.skillsets, known.behaviour, file, place, folder, ways)

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        skillsets: Sequence[Skillset],
        *,
        behaviour: Behaviour | Sequence[str | Path] = (),
        nodes: Sequence[type[Node]] = (),
        inputs: Mapping[str, object] | None = None,
        library: Sequence[str | Path] = (),
        main: str = "",
        enums: Mapping[str, float] | None = None,
    ) -> Mission:
        """Return the mission of a tree's file that belongs to no robot.

        Args:
            path: BehaviorTree.CPP 4's XML.
            skillsets: the models of all skills that it calls.
            behaviour: what their mocks do, or files that say so; what nothing is said of lasts a second and ends with its first result.
            nodes: types of nodes of one's own, as `alula.trees.register` has them.
            inputs: for the input ports of its main tree that have no default.
            library: folders and files whose trees it may use without including them.
            main: the ID of its main tree, where the file does not say it.
            enums: numbers of names that its scripts may use.

        Raises:
            AlulaError: the file can't be used, or one of the behaviour files is wrong.
        """
        file, models = Path(path), tuple(skillsets)
        does = behaviour if isinstance(behaviour, Behaviour) else load_behaviour(list(map(Path, behaviour)), models)
        others = Library()
        others.add(map(Path, library))
        source = TreeSource(file, others, main, enums or {})
        return cls(plan_of_file(source, file.stem, models, inputs or {}, MissionPart(tuple(nodes))), models, does, file)

    def run(self, *faults: Fault, seed: int = 0, out: str | Path | None = None) -> MockedMission:
        """Run it over mocks to its end, in virtual time; return the finished mission.

        The same faults and seed make the same run.

        Args:
            faults: what fails on the way, as ``laser@20``: 20 s after the robot's departure.
            seed: of the mocks' chance.
            out: a folder for its record, which `alula.open_run` opens; None: it leaves nothing behind.

        Raises:
            AlulaError: the mocks have no such fault, the scenario not in this way, or the folder is not empty.
        """
        mission = self.mocked(*faults, seed=seed, out=out)
        with meaning(self.robot):
            mission.run()
            if out is not None:
                note_account(Path(out), mission, _requests(faults))
        return mission

    def mocked(
        self,
        *faults: Fault,
        seed: int = 0,
        out: str | Path | None = None,
        tick_period_s: float = TICK_PERIOD_S,
        latency_s: float = LATENCY_S,
        groot: str = "",
        monitor: bool = False,
        limit_s: float = 0.0,
        listener: Listener | None = None,
    ) -> MockedMission:
        """Return the mission over mocks before its first tick, for programs that schedule acts of their own on its clock.

        Args:
            faults: as for `run`.
            seed: as for `run`.
            out: as for `run`.
            tick_period_s: of the tree, besides the ticks after events.
            latency_s: of each message between the mission and the managers of its skills.
            groot: ``HOST:PORT`` where Groot2 and its like find the tree; empty: nowhere.
            monitor: noted in the run's folder only.
            limit_s: mission clock after which it is aborted; 0: after an hour.
            listener: receives, where ``out`` is None, what would have been recorded.

        Raises:
            AlulaError: the mocks have no such fault, the folder is not empty, or the address can't be had.
        """
        requests = _requests(faults)
        try:
            check_faults(requests, self.behaviour, [one.name for one in self.skillsets], self.ways)
        except SkillRuntimeError as error:
            raise FaultError(str(error)) from None
        folder = None if out is None else Path(out).expanduser().absolute()
        if folder is not None:
            _make_empty(folder)
            RunSpec(
                scenario=self.plan.scenario,
                out_dir=str(folder),
                run_id=uuid.uuid4().hex,
                seed=seed,
                limit_s=limit_s,
                faults=tuple(map(str, requests)),
                world=self.world,
                monitor=monitor,
                groot=groot,
                robot="" if self.robot is None else str(self.robot.root),
                own={"mock": True},
            ).save(folder / FILE)
        with meaning(self.robot):
            return MockedMission(
                self.skillsets,
                self.behaviour,
                self.plan,
                faults=requests,
                seed=seed,
                out=folder,
                tick_period_s=tick_period_s,
                latency_s=latency_s,
                groot=groot,
                listener=listener,
                limit_s=limit_s or LIMIT_S,
            )

    def odds(self, change: str = "", *, unlikely: float = 0.0) -> Odds:
        """Return how likely it is accomplished, degraded or given up, by the figures of the robot's ``faults.yaml``.

        Args:
            change: what is asked for besides, as ``laser=never`` or ``laser=2`` (two of them).
            unlikely: situations that are less likely are not looked at: the bounds hold, and are wider.

        Raises:
            AlulaError: it belongs to no robot, a figure is wrong, or Storm (``pip install stormpy``) is not there.
        """
        from alula.odds.odds import changed, odds_of
        from alula.odds.robot import graph_of

        if self.robot is None:
            raise OddsError(f"{self.path}: belongs to no robot, so there are no figures; load it with `Mission.load(scenario, robot)`")
        with meaning(self.robot):
            graph, figures = graph_of(self.path, self.world, unlikely=unlikely)
            return odds_of(graph, changed(figures, change, graph) if change else figures)


def note_account(out: Path, mission: MockedMission, faults: Sequence[FaultRequest]) -> None:
    """Write into a run's folder when each fault took effect, and how fast the mocks ran."""
    simulated_s = mission.world.now_s
    spans = spans_of(faults, begun_s=0.0, lift_off_s=mission.departure_s, ended_s=simulated_s, first_s=mission.faults)
    note_mocked(out, simulated_s, mission.wall_s, changes_of(spans, simulated_s, MOCKED), mission.notes)


def _requests(faults: Sequence[Fault]) -> list[FaultRequest]:
    return [parse_fault(fault) if isinstance(fault, str) else fault for fault in faults]


def _make_empty(folder: Path) -> None:
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise RequestError(f"{folder}: exists and is not an empty folder; choose another, a run never overwrites")
    folder.mkdir(parents=True, exist_ok=True)
