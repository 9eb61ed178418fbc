"""What a campaign of flights over mocks sees of altered missions: each mutant flies what the mission as it is flies, by the same draws."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Hashable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.campaign.plan import Campaign, PlannedRun
from alula.campaign.rows import came_back
from alula.missions.director import Outcome
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import MissionPart
from alula.missions.plan import InputError, MissionPlan
from alula.model.model import Skillset
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from mission_mutations.judging import Robot, in_place
from mission_mutations.mutants import Mutant

REFUSED, WRONG, OTHERWISE, NOTHING = "refused", "wrong", "otherwise", "nothing"
IN_ORDER = frozenset({Outcome.ACCOMPLISHED, Outcome.DEGRADED, Outcome.GIVEN_UP})


@dataclass(frozen=True)
class Flown:
    """A flight: what is wrong with it by itself, and all that happened in it, in order, with what the mission told at its end."""

    wrong: frozenset[str]
    course: tuple[Hashable, ...]


@dataclass(frozen=True)
class Campaigned:
    """What a campaign sees of a mutant.

    Attributes:
        by: "refused" (the file is none that flies), "wrong": a flight shows something by itself that the same flight of the mission as it
            is does not; "otherwise": a flight takes another course than that; "nothing".
        told: what it was.
        first: the flight that showed it first, counted from 1; 0 where none did.
        flights: so many were flown: up to the first that is wrong, or all.
    """

    mission: str
    kind: str
    what: str
    by: str
    told: str
    first: int
    flights: int
    cpu_s: float

    @property
    def said(self) -> str:
        """In words."""
        return f"{self.by} ({self.flights} flights)"

    @property
    def again(self) -> bool:
        """Return whether it is worth to be flown again."""
        return False

    def as_dict(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return asdict(self)


class Flights:
    """The flights of a campaign that are of one mission."""

    def __init__(self, robot: Robot, mission: str, campaign: Campaign) -> None:
        self._robot = robot
        self._mission = mission
        self._runs = [run for run in campaign.runs if run.scenario == mission]
        self._scenario = load_mocked_scenario(mission, campaign.behaviour)
        self._original: dict[int, Flown] = {}

    def judge(self, mutant: Mutant) -> Campaigned:
        """Fly a mutant."""
        begun = time.process_time()
        with tempfile.TemporaryDirectory(prefix="alula-mutant-") as folder:
            missions = Path(folder) / "missions"
            shutil.copytree(self._robot.folder, missions)
            if mutant.file:
                (missions / mutant.file).write_text(mutant.text, encoding="utf-8")
            skillsets = [in_place(one, mutant.skillset) for one in self._scenario.skillsets]
            said = self._said(missions / f"{self._mission}.xml", skillsets, mutant.part_of(self._robot.part))
        return Campaigned(self._mission, mutant.kind, mutant.what, *said, round(time.process_time() - begun, 2))

    def _said(self, path: Path, skillsets: Sequence[Skillset], part: MissionPart) -> tuple[str, str, int, int]:
        try:
            plan = plan_of_file(path, self._mission, skillsets, self._scenario.inputs, part)
        except InputError as error:
            return REFUSED, str(error), 0, 0
        otherwise: tuple[str, int] | None = None
        for number, run in enumerate(self._runs, 1):
            before, after = self._as_it_is(number, run), self._fly(run, plan, skillsets)
            if wrong := after.wrong - before.wrong:
                return WRONG, "; ".join(sorted(wrong)), number, number
            if otherwise is None and after.course != before.course:
                otherwise = _difference(before, after), number
        if otherwise is not None:
            return OTHERWISE, *otherwise, len(self._runs)
        return NOTHING, "", 0, len(self._runs)

    def _as_it_is(self, number: int, run: PlannedRun) -> Flown:
        if number not in self._original:
            self._original[number] = self._fly(run, self._scenario.plan, self._scenario.skillsets)
        return self._original[number]

    def _fly(self, run: PlannedRun, plan: MissionPlan, skillsets: Sequence[Skillset]) -> Flown:
        mission = MockedMission(skillsets, self._scenario.behaviour, plan, faults=run.requests, seed=run.seed)
        end = mission.run()
        wrong = {f"it ends {end.outcome.value}"} if end.outcome not in IN_ORDER else set()
        wrong |= {"it is left where it may not stay"} if came_back(mission.events) is False else set()
        wrong |= {"a skill runs on"} if mission.open_executions else set()
        wrong |= {f"the mocks say: {note}" for note in mission.notes}
        course: list[Hashable] = []
        for event in mission.events:
            if isinstance(event, ExecutionEvent):
                course.append((event.skillset, event.skill, event.state.value, event.result, str(event.inputs)))
            elif isinstance(event, TransitionEvent):
                course.append((event.skillset, event.resource, event.to_state))
        facts = tuple(f"{name}: {value}" for name, value in plan.facts().items())
        return Flown(frozenset(wrong), (*course, (end.outcome.value, end.reason, *facts)))


def _difference(before: Flown, after: Flown) -> str:
    """Return in words where a course leaves another first."""
    pairs = zip((*before.course, "nothing"), (*after.course, "nothing"), strict=False)
    one, other = next((one, other) for one, other in pairs if one != other)
    return f"{one} becomes {other}"
