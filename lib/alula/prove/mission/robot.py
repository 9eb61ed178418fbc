"""Stand-ins for a robot when a mission's tree is ticked in the search: its clients, and the executions of its skills."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from alula.missions.context import Failure, MissionContext
from alula.missions.pending import PendingInterrupts
from alula.missions.skill_types import type_of
from alula.missions.skills import SkillNode
from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.prove.mission.measured import Conditions, Measurements
from alula.prove.mission.moments import Moment
from alula.prove.mission.oracle import Oracle
from alula.prove.mission.states import Compared, SeenState
from alula.prove.mission.unknown import UnknownNumber, unknown
from alula.prove.mission.uses import Uses
from alula.runtime.handle import SkillHandle

NO_END = ("sent",)
Position = int
"""A number of questions that a tick has asked."""


@dataclass
class Robot:
    """What all stand-ins share: the oracle of the tick, and the requests of the tree in it."""

    oracle: Oracle
    conditions: Conditions = Conditions()  # noqa: RUF009 - a value
    """What the mission's conditions ask of data."""
    compared: Compared = Compared()  # noqa: RUF009 - a value
    """The resources that its scripts only compare with states."""
    uses: Uses = Uses()  # noqa: RUF009 - a value
    """Of which type values are that nodes without a class write."""
    starting: int = -1
    """The leaf that starts a skill now."""
    started: list[int] = field(default_factory=list)
    interrupted: list[int] = field(default_factory=list)
    come_again: Callable[[Position], bool] = lambda _: False
    """Tells a node that does one thing after another that all is as it was after fewer or other things of its; a play never does."""
    now: Moment = field(init=False)
    measurements: Measurements = field(init=False)

    def __post_init__(self) -> None:
        self.now = Moment(self.oracle, now=True)
        self.measurements = Measurements(self.oracle, self.conditions)

    def clock_ns(self) -> int:
        """Return now: no number, but an object that computes with times as one."""
        return self.now  # type: ignore[return-value]

    def begin(self) -> None:
        """Begin another tick."""
        self.started, self.interrupted = [], []
        self.measurements.begin()
        self.now = Moment(self.oracle, now=True)


class Handle:
    """An execution as the tree's leaf sees it; ``fresh``: it was requested in this very tick."""

    message = ""

    def __init__(self, robot: Robot, leaf: int, skillset: Skillset, skill: str, *, fresh: bool = False, failed: bool = False) -> None:
        self.leaf = leaf
        self.id = str(leaf)
        self.skillset = skillset.name
        self.skill = skill
        self._robot = robot
        self._outputs = skillset.skill(skill).outputs
        self.fixed = ("ended", ExecutionState.FAILED.value, "") if failed else NO_END if fresh else None

    @property
    def _seen(self) -> tuple[str, ...]:
        return self.fixed or self._robot.oracle.look(("execution", self.leaf))  # type: ignore[return-value]

    @property
    def state(self) -> ExecutionState:
        """The state that the client has received last."""
        phase, *end = self._seen
        if phase == "ended":
            return ExecutionState(end[0])
        return ExecutionState.RUNNING if phase == "running" else ExecutionState.REQUESTED

    @property
    def done(self) -> bool:
        """Return whether it has ended."""
        return self._seen[0] == "ended"

    @property
    def result(self) -> str:
        """The result; empty before the end."""
        return self._seen[2] if self.done else ""

    @property
    def outputs(self) -> Mapping[str, object]:
        """Unknown values: nothing is known of what a function returns."""
        return {one.name: unknown(self._robot.oracle, f"{self.skill}'s {one.name}", type_of(one.type)) for one in self._outputs}

    @property
    def progress(self) -> float:
        """An unknown number, not negative."""
        return UnknownNumber(self._robot.oracle, progress_of(self.skillset, self.skill), 0.0)

    def interrupt(self) -> None:
        """Request the interruption."""
        if not self.done:
            self._robot.interrupted.append(self.leaf)


class States(Mapping[str, str]):
    """The states of a skillset's resources, as its client knows them; none while the managers are not there."""

    def __init__(self, robot: Robot, skillset: Skillset) -> None:
        self._robot = robot
        self._skillset = skillset

    def __getitem__(self, name: str) -> str:
        if name not in self._skillset.resource_index:
            raise KeyError(name)
        if f"{self._skillset.name}.{name}" in self._robot.compared.resources:
            return SeenState(self._robot.oracle, self._robot.compared, self._skillset.name, name)  # type: ignore[return-value]
        state = self._robot.oracle.look(("resource", self._skillset.name, name))
        if state is None:
            raise KeyError(name)
        return str(state)

    def __iter__(self) -> Iterator[str]:
        return iter(self._skillset.resource_index)

    def __len__(self) -> int:
        return len(self._skillset.resource_index)


class Client:
    """A skillset's client as missions use it."""

    def __init__(self, robot: Robot, skillset: Skillset) -> None:
        self.skillset = skillset.name
        self.resources = States(robot, skillset)
        self.reasons: Mapping[str, str] = {}
        """Words decide nothing."""
        self._robot = robot
        self._model = skillset

    @property
    def ready(self) -> bool:
        """Return whether the managers are there."""
        return bool(self._robot.oracle.look(("alive", self.skillset)))

    def follow(self, data: Collection[str]) -> None:
        """Ignore it: the search has no data to follow."""

    def value(self, data: str) -> object | None:
        """Return a value bounded only by the answers of this tick."""
        return self._robot.measurements.value(f"{self.skillset}.{data}")

    def start(self, skill: str, **_inputs: object) -> Handle:
        """Request an execution; it has FAILED where the managers are not there."""
        leaf = self._robot.starting
        if not self.ready:
            return Handle(self._robot, leaf, self._model, skill, failed=True)
        self._robot.started.append(leaf)
        return Handle(self._robot, leaf, self._model, skill, fresh=True)


def progress_of(skillset: str, skill: str) -> str:
    """Return the name of a skill's progress in counterexamples."""
    return f"the progress of {skillset}.{skill}"


class Waits(PendingInterrupts):
    """Executions that end some time after they were interrupted, always before the bound: the managers know which have not.

    ``skillsets`` are asked one by one; those of ``holding`` may have one that starts everywhere wait for.
    """

    def __init__(self, robot: Robot, skillsets: Collection[str], leaves: Sequence[SkillNode]) -> None:
        super().__init__(robot.clock_ns, math.inf)
        self._robot = robot
        self._skillsets = skillsets
        self._leaves = leaves

    def interrupt(self, skillset: str, skill: str, handle: SkillHandle, *, holds_all: bool = False) -> None:  # noqa: ARG002
        """Request the interruption of an execution; the managers remember it."""
        handle.interrupt()

    def names(self, skillset: str | None = None) -> list[str]:
        """Return the first of the skillsets whose executions a start waits for, in a list; empty: none."""
        for one in self._skillsets:
            if skillset in {None, one}:
                if self._any(one, holds_all=False):
                    return [one]
            elif any(leaf.leaf.halt_waits and leaf.skillset == one for leaf in self._leaves) and self._any(one, holds_all=True):
                return [one]
        return []

    def _any(self, skillset: str, *, holds_all: bool) -> bool:
        mine = {number for number, one in enumerate(self._leaves) if one.skillset == skillset and (one.leaf.halt_waits or not holds_all)}
        return not mine.isdisjoint(self._robot.interrupted) or bool(self._robot.oracle.look(("interrupted", skillset, holds_all)))


class SummaryContext(MissionContext):
    """A mission's context that keeps of the failures what scripts ask for."""

    def recall_failures(self, first: str, ends: frozenset[str]) -> None:
        """Set the failures: the skill that failed first, and the ends of all that failed."""
        known = [Failure("", first, ExecutionState.FAILED, "", "")] if first else []
        self.failures = known + [Failure("", "", ExecutionState.FAILED, end, "") for end in sorted(ends)]
        self.reason = ""
