"""All steps out of a situation, each taken by ``alula.model.semantics``, which the managers execute.

A situation is kept as small as its future needs: the states of the resources and the names of the running skills.
Executions of one skill differ in nothing but their age. The order of the start decides in which order violations take
effect; skills whose violations change nothing are therefore kept sorted by name, before the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from alula.model import semantics
from alula.model.conditions import holds
from alula.model.effects import effect_changes
from alula.model.errors import EffectError
from alula.model.execution_state import ExecutionState
from alula.model.model import Effect, Skill, Skillset
from alula.model.situation import Entered, Running, Situation, Step
from alula.prove.skillset.abstract import Abstraction, Breaker

Key = tuple[str, ...]
"""What fails: ``("effect" | "post", kind, names...)`` or ``("after start", skill, invariant)``, as in ``local.Suspect``."""


@dataclass(frozen=True)
class State:
    """A situation: the state of each resource, and the running skills in the order that matters."""

    resources: tuple[str, ...]
    running: tuple[str, ...] = ()


@dataclass(frozen=True)
class Move:
    """A step to ``target``. ``kind`` and ``subject`` say what asked for it; ``ended`` names the skills that it ended."""

    kind: str
    subject: tuple[str, ...]
    target: State
    ended: tuple[str, ...] = ()
    faults: tuple[Key, ...] = ()
    step: Step | None = None
    execution: str = ""
    """The execution that starts, ends or breaks, as ``step`` calls it."""


@dataclass(frozen=True)
class Part:
    """What may happen of its own accord in a part of a skillset: skills that start, resources changed from outside, events."""

    skills: frozenset[str]
    resources: frozenset[str]
    events: frozenset[str]


class World:
    """The steps of one skillset. ``copies`` is how many executions of one skill are looked at, at most.

    With a ``part`` of it, nothing else is asked for: each run of it is a run of the skillset.
    """

    def __init__(self, abstraction: Abstraction, *, copies: int = 2, part: Part | None = None) -> None:
        self.abstraction = abstraction
        self.skillset: Skillset = abstraction.skillset
        self.copies = copies
        self.crowded: set[str] = set()
        """Skills of which more executions could have started than are looked at, and would have mattered."""
        self._breakers = abstraction.breakers
        self._births = abstraction.births
        self._startable = [s for s in self.skillset.skills if part is None or s.name in part.skills]
        self._changing = [r for r in self.skillset.resources if part is None or r.name in part.resources]
        self._happening = [e for e in self.skillset.events if part is None or e.name in part.events]
        self._names = tuple(resource.name for resource in self.skillset.resources)
        self._ordered = {s.name for s in self.skillset.skills if any(i.effect.assignments for i in s.invariants)}
        self.idle = {s.name for s in self.skillset.skills if not any(effect.assignments for effect in effects_of(s))}

    # --- situations -----------------------------------------------------------------------------------------------

    def initial(self) -> State:
        """Return the state at the start."""
        return self.state(semantics.initial(self.skillset))

    def state(self, situation: Situation) -> State:
        """Return the state of a situation."""
        running = tuple(execution.skill for execution in self.in_order(situation.running))
        return State(tuple(situation.states[name] for name in self._names), running)

    def in_order(self, running: Sequence[Running]) -> list[Running]:
        """Return executions in the order in which a state has them."""
        sortable = sorted((one for one in running if one.skill not in self._ordered), key=lambda one: one.skill)
        return [*sortable, *(one for one in running if one.skill in self._ordered)]

    def situation(self, state: State) -> Situation:
        """Return a situation of this state; executions are numbered by their age."""
        running = tuple(Running(str(number), skill) for number, skill in enumerate(state.running, 1))
        return Situation(dict(zip(self._names, state.resources, strict=True)), running)

    # --- steps ----------------------------------------------------------------------------------------------------

    def moves(self, state: State) -> Iterator[Move]:
        """Yield every step out of a state, also those that change nothing but show a fault."""
        situation = self.situation(state)
        yield from self._extern(situation)
        yield from self._events(situation)
        yield from self._starts(situation)
        yield from self._ends(situation)
        yield from self._breaks(situation)

    def _extern(self, situation: Situation) -> Iterator[Move]:
        for resource in self._changing:
            source = situation.states[resource.name]
            for target in resource.targets(source, extern=True):
                step = semantics.transition(self.skillset, situation, resource.name, target)
                yield self._move(self._taker(resource.name, source, target), (resource.name, target), step)

    def _events(self, situation: Situation) -> Iterator[Move]:
        for event in self._happening:
            if not holds(event.guard, situation.states, {}):
                continue
            if semantics.event_refusal(self.skillset, situation, event.name):
                yield Move("event", (event.name,), self.state(situation), faults=(("effect", "event", event.name),))
            elif event.effect.assignments:
                yield self._move("event", (event.name,), semantics.event(self.skillset, situation, event.name))

    def _starts(self, situation: Situation) -> Iterator[Move]:
        counts = [execution.skill for execution in situation.running]
        for skill in self._startable:
            if next(semantics.unmet_preconditions(skill, situation.states, {}), None) is not None:
                continue
            if self._fails(skill, skill.start, situation):
                yield Move("start", (skill.name,), self.state(situation), faults=(("effect", "start", skill.name),))
                continue
            if counts.count(skill.name) >= self.copies:
                # One more that changes nothing adds nothing that the others do not show.
                self.crowded |= {skill.name} - self.idle
                continue
            step = semantics.start(self.skillset, situation, Running("new", skill.name))
            faults = (*self._broken_at_birth(skill, step), *self._broken_by_data(skill, situation))
            yield self._move("start", (skill.name,), step, faults, "new")

    def _ends(self, situation: Situation) -> Iterator[Move]:
        seen: set[tuple[State, tuple[str, ...]]] = set()
        for execution in situation.running:
            for move in self._ends_of(situation, execution):
                if (move.target, move.subject) not in seen:
                    seen.add((move.target, move.subject))
                    yield move

    def _ends_of(self, situation: Situation, execution: Running) -> Iterator[Move]:
        skill = self.skillset.skill(execution.skill)
        for result in skill.results:
            key: Key = ("result", skill.name, result.name)
            step = semantics.terminate(self.skillset, situation, execution, result.name)
            faults = self._end_faults(skill, result.effect, key, situation, step, execution)
            yield self._move("terminate", (skill.name, result.name), step, faults, execution.id)
        key = ("interrupt", skill.name)
        step = semantics.interrupt(self.skillset, situation, execution)
        faults = self._end_faults(skill, skill.interrupt.effect, key, situation, step, execution)
        yield self._move("interrupt", (skill.name,), step, faults, execution.id)

    def _breaks(self, situation: Situation) -> Iterator[Move]:
        seen: set[tuple[State, str, str]] = set()
        for breaker in self._breakers:
            for execution in situation.running:
                if execution.skill != breaker.skill or not holds(breaker.when, situation.states, {}):
                    continue
                step = self._lost(situation, execution, breaker)
                move = self._move("data", (breaker.skill, breaker.invariant), step, execution=execution.id)
                if (move.target, *move.subject) not in seen:
                    seen.add((move.target, breaker.skill, breaker.invariant))
                    yield move

    def _lost(self, situation: Situation, execution: Running, breaker: Breaker) -> Step:
        return semantics.lose(self.skillset, situation, execution, breaker.invariant)

    # --- faults ---------------------------------------------------------------------------------------------------

    def _taker(self, resource: str, source: str, target: str) -> str:
        return "outside" if (resource, source, target) in self.abstraction.outside else "extern"

    def _move(self, kind: str, subject: tuple[str, ...], step: Step, faults: tuple[Key, ...] = (), execution: str = "") -> Move:
        ended = tuple(h.execution.skill for h in step.happenings if isinstance(h, Entered) and h.state is not ExecutionState.RUNNING)
        return Move(kind, subject, self.state(step.situation), ended, (*faults, *self._violation_faults(step)), step, execution)

    def _fails(self, skill: Skill, effect: Effect, situation: Situation) -> bool:
        try:
            effect_changes(self.skillset, Running("", skill.name), effect, "", situation.states)
        except EffectError:
            return True
        return False

    def _end_faults(self, skill: Skill, effect: Effect, key: Key, situation: Situation, step: Step, execution: Running) -> tuple[Key, ...]:
        if self._fails(skill, effect, situation):
            return (("effect", *key),)
        entered = next(h for h in step.happenings if isinstance(h, Entered) and h.execution == execution)
        return (("post", *key),) if entered.state is ExecutionState.FAILED else ()

    @staticmethod
    def _violation_faults(step: Step) -> tuple[Key, ...]:
        """Find violations whose effect was not possible."""
        failed = [entered for entered in step.happenings if isinstance(entered, Entered) and entered.effect_failed]
        return tuple(("effect", "invariant", entered.execution.skill, entered.result) for entered in failed)

    @staticmethod
    def _broken_at_birth(skill: Skill, step: Step) -> tuple[Key, ...]:
        for entered in step.happenings:
            if isinstance(entered, Entered) and entered.execution.id == "new" and entered.state is not ExecutionState.RUNNING:
                return (("after start", skill.name, entered.result),)
        return ()

    def _broken_by_data(self, skill: Skill, situation: Situation) -> tuple[Key, ...]:
        """Find invariants that data may make false right after the start."""
        births = [birth for birth in self._births if birth.skill == skill.name and holds(birth.when, situation.states, {})]
        return tuple(("after start", skill.name, birth.invariant) for birth in births)


def effects_of(skill: Skill) -> Iterator[Effect]:
    """Yield the effects of a skill: of its start, its interruption, its invariants and its results."""
    yield skill.start
    yield skill.interrupt.effect
    for invariant in skill.invariants:
        yield invariant.effect
    for result in skill.results:
        yield result.effect
