"""Worlds that a repair has to hold out in, made without the steps of the search.

- Flights: the mission's own tree over the real managers, in virtual time. Either one fault comes, at each moment, and nothing else fails;
  or everything fails that a model has: any result, any transition of the functional layer, at any time.
- Brute force: every situation that managers of a small skillset can be brought into, by rules of their own (paper, Figure 5).
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from alula.common.faults import FaultRequest
from alula.missions.director import Outcome
from alula.missions.mission_file import plan_of_file
from alula.missions.mocked import MockedMission
from alula.missions.part import NO_PART
from alula.mock import NEVER, Behaviour, Ending, MockFault, Rule
from alula.mock.behaviour import Place
from alula.model.execution_state import ExecutionState
from alula.model.expressions import And, Expression, Implies, MissionIs, Not, Or, ResourceIs, SkillRuns
from alula.model.model import Assignment, ResultKind, Skill, Skillset
from alula.records.causes.effects import FaultEffects
from alula.runtime.core.events import EngineEvent

LONG_S = 300.0
"""No fair flight of a random mission takes so long."""
GOOD = frozenset({Outcome.ACCOMPLISHED, Outcome.DEGRADED})


@dataclass
class Flight:
    """A flight of a mission's file, and what is seen of it after each step of its managers.

    Attributes:
        never: conditions of properties, by name, that must not come true.
        broken: the properties of which one did.
    """

    mission: MockedMission
    never: Mapping[str, Expression] = field(default_factory=dict)
    broken: list[str] = field(default_factory=list)

    def fly(self) -> Outcome:
        """Fly to the end."""
        self.mission.world.on_event(self._on_event)
        outcome = self.mission.run().outcome
        self._look()
        assert self.mission.open_executions == []
        return outcome

    def _on_event(self, _skillset: str, _event: EngineEvent) -> None:
        self.mission.world.clock.soon(self._look)

    def _look(self) -> None:
        self.broken += [name for name, condition in self.never.items() if self._is_true(condition) and name not in self.broken]

    def _is_true(self, condition: Expression) -> bool:
        match condition:
            case ResourceIs(resource=name, state=state, negated=negated):
                skillset, _, resource = name.partition(".")
                return (self.mission.state(skillset, resource) == state) != negated
            case SkillRuns(skill=name):
                skillset, _, skill = name.partition(".")
                running = self.mission.world.managers[skillset].engine.executions
                return any(one.skill == skill and one.state is ExecutionState.RUNNING for one in running)
            case MissionIs(name=name):
                return self.mission.end is not None and self.mission.end.outcome.value == name
            case Not(operand=operand):
                return not self._is_true(operand)
            case And(operands=several):
                return all(map(self._is_true, several))
            case Or(operands=several):
                return any(map(self._is_true, several))
            case Implies(premise=premise, conclusion=conclusion):
                return not self._is_true(premise) or self._is_true(conclusion)
            case _:
                raise ValueError(condition)


@dataclass(frozen=True)
class Sky:
    """Where a mission's file is flown.

    Attributes:
        path: of the file.
        effects: of the robot's faults.
    """

    path: Path
    skillsets: Sequence[Skillset]
    effects: Mapping[str, FaultEffects]
    never: Mapping[str, Expression] = field(default_factory=dict)

    def with_faults(self, faults: Mapping[str, float], seed: int) -> Outcome:
        """Fly with faults, each from a moment on: they stay, what they end they end once more at most, and nothing else fails."""
        chance = random.Random(seed)  # noqa: S311 - for tests
        mocked = {name: _mocked(self.effects[name]) for name in faults}
        requests = [FaultRequest(name, begin_s=at_s) for name, at_s in faults.items()]
        mission = self._mission(Behaviour(rules=self._rules(_well, chance), faults=mocked), seed, *requests)
        for name, at_s in faults.items():
            for place, result in mocked[name].ends.items():
                _end_once_more(mission, place, result, at_s, chance)
        return Flight(mission).fly()

    def with_anything(self, seed: int) -> list[str]:
        """Fly with all that can fail; return the properties that do not hold."""
        chance = random.Random(seed)  # noqa: S311 - for tests
        mission = self._mission(Behaviour(rules=self._rules(_anyhow, chance)), seed)
        for of in self.skillsets:
            for resource in of.resources:
                extern = [one for one in resource.transitions if one.extern]
                for _ in range(chance.randrange(12) if extern else 0):
                    move = partial(mission.world.managers[of.name].transition, resource.name, chance.choice(extern).target)
                    mission.world.clock.after(chance.uniform(0.0, chance.choice((1.0, 5.0, 20.0))), move)
        flight = Flight(mission, self.never)
        flight.fly()
        return flight.broken

    def without_faults(self, seed: int) -> MockedMission:
        """Return a flight in which nothing fails."""
        mission = self._mission(Behaviour(rules=self._rules(_well, random.Random(seed))), seed)  # noqa: S311 - for tests
        mission.run()
        return mission

    def moments(self, seed: int) -> list[float]:
        """Return a moment after each event of a flight in which nothing fails, seconds of mission clock."""
        seen = {one.stamp_ns for one in self.without_faults(seed).events if one.stamp_ns > 0}
        return sorted(stamp_ns / 1e9 + 0.001 for stamp_ns in seen)

    def _rules(self, rules: Callable[[Skill, random.Random], tuple[Rule, ...]], chance: random.Random) -> dict[Place, tuple[Rule, ...]]:
        return {(of.name, one.name): rules(one, chance) for of in self.skillsets for one in of.skills}

    def _mission(self, behaviour: Behaviour, seed: int, *faults: FaultRequest) -> MockedMission:
        plan = plan_of_file(self.path, "main", self.skillsets, {}, NO_PART)
        return MockedMission(self.skillsets, behaviour, plan, faults=faults, seed=seed, limit_s=LONG_S)


def _mocked(effects: FaultEffects) -> MockFault:
    states = {_place(text): state for text, state in (one.rsplit(" ", 1) for one in effects.states)}
    return MockFault(states, ends={_place(text): result for text, result in (one.rsplit(" ", 1) for one in effects.ends)})


def _end_once_more(mission: MockedMission, place: Place, result: str, at_s: float, chance: random.Random) -> None:
    """Have a fault end an execution of a skill once more: with its coming that is as often as faults may come."""
    engine = mission.world.managers[place[0]].engine

    def strike() -> None:
        for one in engine.executions:
            if one.skill == place[1] and one.state is ExecutionState.RUNNING:
                engine.terminate(one.id, result)

    mission.world.clock.after(at_s + chance.expovariate(0.5), strike)


def _place(text: str) -> Place:
    skillset, _, member = text.partition(".")
    return skillset, member


def _well(skill: Skill, chance: random.Random) -> tuple[Rule, ...]:
    good = [(one.name, 1.0) for one in skill.results if skill.kind_of(one.name) is ResultKind.SUCCESS]
    return (Rule(delay=chance.uniform(0.1, 3.0), ending=Ending(tuple(good)) if good else NEVER, progress=1.0),)


def _anyhow(skill: Skill, chance: random.Random) -> tuple[Rule, ...]:
    ends = [(one.name, 1.0) for one in skill.results]
    calls = [Rule(call=call, delay=chance.uniform(0.05, 4.0), ending=_any_end(ends, chance)) for call in range(1, 6)]
    return (*calls, Rule(delay=1.0, ending=Ending(tuple(ends)) if ends else NEVER))


def _any_end(ends: Sequence[tuple[str, float]], chance: random.Random) -> Ending:
    return Ending(refuse="no") if chance.random() < 0.1 else Ending(tuple(ends)) if ends else NEVER


# --- brute force --------------------------------------------------------------------------------------------------------

States = tuple[str, ...]
Situation = tuple[States, frozenset[str], bool]
"""States of the resources, skills that run, and whether the fault has come."""


@dataclass(frozen=True)
class Brute:
    """All that can be done with the skills of one skillset while nothing hinders: each starts, ends and is interrupted at any time."""

    skillset: Skillset
    fault: frozenset[tuple[str, str]]

    def can_run(self, skill: str) -> bool:
        """Return whether a skill can be started while the fault is there, which stays once it has come."""
        first: Situation = (tuple(one.initial for one in self.skillset.resources), frozenset(), False)
        seen, todo = {first}, deque([first])
        while todo:
            here = todo.popleft()
            for started, there in self._moves(*here):
                if started == skill and here[2] and skill in there[1]:
                    return True
                if there not in seen:
                    seen.add(there)
                    todo.append(there)
        return False

    def _moves(self, states: States, running: frozenset[str], come: bool) -> Iterator[tuple[str, Situation]]:  # noqa: FBT001
        for skill in self.skillset.skills:
            if skill.name not in running and all(self._true(one.condition, states) for one in skill.preconditions):
                yield from self._step(states, running | {skill.name}, come, skill.start.assignments, skill.name)
            if skill.name in running:
                without = running - {skill.name}
                yield from self._step(states, without, come, skill.interrupt.effect.assignments)
                for result in skill.results:
                    yield from self._step(states, without, come, result.effect.assignments)
        for number, resource in enumerate(self.skillset.resources):
            for moved in resource.transitions:
                shows = (resource.name, moved.target) in self.fault
                hides = (resource.name, moved.source) in self.fault and not shows
                if moved.extern and moved.source == states[number] and not (come and hides):
                    after = (*states[:number], moved.target, *states[number + 1 :])
                    yield "", (*self._settled(after, running), come or shows)

    def _step(
        self,
        states: States,
        running: frozenset[str],
        come: bool,  # noqa: FBT001
        effect: Sequence[Assignment],
        started: str = "",
    ) -> Iterator[tuple[str, Situation]]:
        after = self._applied(states, effect)
        if after is not None:
            yield started, (*self._settled(after, running), come)

    def _applied(self, states: States, effect: Sequence[Assignment]) -> States | None:
        now = dict(zip((one.name for one in self.skillset.resources), states, strict=True))
        for one in effect:
            known = self.skillset.resource(one.resource).transitions
            if not any(not moved.extern and (moved.source, moved.target) == (now[one.resource], one.target) for moved in known):
                return None
            now[one.resource] = one.target
        return tuple(now.values())

    def _settled(self, states: States, running: frozenset[str]) -> tuple[States, frozenset[str]]:
        """Return them once each skill with a broken invariant has ended by it."""
        for skill in self.skillset.skills:
            broken = next((one for one in skill.invariants if not self._true(one.condition, states)), None)
            if skill.name in running and broken is not None:
                after = self._applied(states, broken.effect.assignments)
                return self._settled(states if after is None else after, running - {skill.name})
        return states, running

    def _true(self, condition: Expression, states: States) -> bool:
        match condition:
            case ResourceIs(resource=name, state=state, negated=negated):
                return (states[[one.name for one in self.skillset.resources].index(name)] == state) != negated
            case And(operands=several):
                return all(self._true(one, states) for one in several)
            case Or(operands=several):
                return any(self._true(one, states) for one in several)
            case Not(operand=operand):
                return not self._true(operand, states)
            case _:
                raise ValueError(condition)
