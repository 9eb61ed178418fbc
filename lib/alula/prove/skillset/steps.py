"""Represent a skillset as a transition system: the steps of ``alula.model.steps`` between states, and the faults that they show.

A situation is kept as small as its future needs: the states of the resources and the names of the running skills.
Executions of one skill differ in nothing but their age. The order of the start decides in which order violations take
effect; skills whose violations change nothing are therefore kept sorted by name, before the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from alula.language.counterexamples import StepKind
from alula.model import semantics
from alula.model.conditions import holds
from alula.model.effects import effect_changes, effects_of
from alula.model.errors import EffectError
from alula.model.execution_state import ExecutionState
from alula.model.model import Effect, Event, Skill, Skillset
from alula.model.situation import Entered, Running, Situation, Step
from alula.model.steps import Cause, PossibleSteps, Stimulus, outcomes_of, take
from alula.prove.skillset.abstract import Abstraction
from alula.prove.skillset.local import end_key

Key = tuple[str, ...]
"""What fails: ``("effect" | "post", kind, names...)`` or ``("after start", skill, invariant)``, as in ``local.Suspect``."""


@dataclass(frozen=True)
class State:
    """A situation: the state of each resource, and the running skills in the order that matters."""

    resources: tuple[str, ...]
    running: tuple[str, ...] = ()


@dataclass(frozen=True)
class Move:
    """A step to ``target``; without a ``step``, what ``stimulus`` asks for is refused.

    ``kind`` and ``subject`` say what asked for it, whichever execution it is about; ``ended`` names the skills that it ended.
    """

    kind: StepKind
    subject: tuple[str, ...]
    target: State
    stimulus: Stimulus
    ended: tuple[str, ...] = ()
    faults: tuple[Key, ...] = ()
    step: Step | None = None


@dataclass(frozen=True)
class Part:
    """What may happen of its own accord in a part of a skillset: skills that start, resources changed from outside, events."""

    skills: frozenset[str]
    resources: frozenset[str]
    events: frozenset[str]


class TransitionSystem:
    """The transition system of a skillset; at most ``copies`` executions of one skill run at once.

    With a ``part`` of it, nothing else is asked for: each run of it is a run of the skillset.
    """

    def __init__(self, abstraction: Abstraction, *, copies: int = 2, part: Part | None = None) -> None:
        self.abstraction = abstraction
        self.skillset: Skillset = abstraction.skillset
        self.copies = copies
        self.crowded: set[str] = set()
        """Skills of which more executions could have started than are looked at, and would have mattered."""
        self._possible = PossibleSteps(abstraction)
        self._effects = {
            (end.cause, skill.name, end.name): (skill, end.effect, end_key(skill.name, end.name))
            for skill in self.skillset.skills
            for end in outcomes_of(skill)
        }
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
        for resource in self._changing:
            for stimulus in self._possible.of_resource(situation, resource):
                yield self._move(situation, stimulus)
        for event in self._happening:
            yield from self._event(situation, event)
        for skill in self._startable:
            yield from self._start(situation, skill)
        yield from self._ends(situation)

    def _event(self, situation: Situation, event: Event) -> Iterator[Move]:
        stimulus = Stimulus(Cause.EVENT, event.name)
        if event.effect.assignments and stimulus in self._possible.of_event(situation, event.name):
            yield self._move(situation, stimulus)
        elif event.effect.assignments and holds(event.guard, situation.states, {}):
            yield self._fault(situation, stimulus, ("effect", "event", event.name))

    def _start(self, situation: Situation, skill: Skill) -> Iterator[Move]:
        for stimulus in self._possible.of_start(situation, Running("new", skill.name)):
            if self._fails(skill, skill.start, situation):
                yield self._fault(situation, stimulus, ("effect", "start", skill.name))
            elif sum(one.skill == skill.name for one in situation.running) >= self.copies:
                # One more that changes nothing adds nothing that the others do not show.
                self.crowded |= {skill.name} - self.idle
            else:
                move = self._move(situation, stimulus)
                faults = (*self._broken_at_birth(skill, move.step), *self._broken_by_data(skill, situation))
                yield replace(move, faults=(*faults, *move.faults)) if faults else move

    def _ends(self, situation: Situation) -> Iterator[Move]:
        """Yield how executions end; a failure does what an interruption does."""
        seen: set[tuple[State, Cause, tuple[str, ...]]] = set()
        for execution in situation.running:
            for stimulus in self._possible.of_running(situation, execution):
                if stimulus.cause is not Cause.FAIL:
                    move = self._move(situation, stimulus)
                    identity = move.target, stimulus.cause, move.subject
                    if identity not in seen:
                        seen.add(identity)
                        yield move

    def _move(self, situation: Situation, stimulus: Stimulus) -> Move:
        step = take(self.skillset, situation, stimulus)
        ended = tuple(h.execution.skill for h in step.happenings if isinstance(h, Entered) and h.state is not ExecutionState.RUNNING)
        faults = (*self._end_faults(situation, stimulus, step), *self._violation_faults(step))
        return Move(self._kind(situation, stimulus), _subject(stimulus), self.state(step.situation), stimulus, ended, faults, step)

    def _kind(self, situation: Situation, stimulus: Stimulus) -> StepKind:
        if stimulus.cause is Cause.EXTERN and self.abstraction.outside:
            transition = stimulus.name, situation.states[stimulus.name], stimulus.target
            return StepKind.OUTSIDE if transition in self.abstraction.outside else StepKind.EXTERN
        return _KINDS[stimulus.cause]

    # --- faults ---------------------------------------------------------------------------------------------------

    def _fault(self, situation: Situation, stimulus: Stimulus, fault: Key) -> Move:
        """Return that what is asked for is refused, because its effect is no transition."""
        return Move(_KINDS[stimulus.cause], _subject(stimulus), self.state(situation), stimulus, faults=(fault,))

    def _fails(self, skill: Skill, effect: Effect, situation: Situation) -> bool:
        try:
            effect_changes(self.skillset, Running("", skill.name), effect, "", situation.states)
        except EffectError:
            return True
        return False

    def _end_faults(self, situation: Situation, stimulus: Stimulus, step: Step) -> tuple[Key, ...]:
        end = self._effects.get((stimulus.cause, stimulus.execution.skill, stimulus.name))
        if end is None:
            return ()
        skill, effect, key = end
        if self._fails(skill, effect, situation):
            return (("effect", *key),)
        entered = next(h for h in step.happenings if isinstance(h, Entered) and h.execution == stimulus.execution)
        return (("post", *key),) if entered.state is ExecutionState.FAILED else ()

    @staticmethod
    def _violation_faults(step: Step) -> tuple[Key, ...]:
        """Find violations whose effect was not possible."""
        failed = [entered for entered in step.happenings if isinstance(entered, Entered) and entered.effect_failed]
        return tuple(("effect", "invariant", entered.execution.skill, entered.result) for entered in failed)

    @staticmethod
    def _broken_at_birth(skill: Skill, step: Step | None) -> tuple[Key, ...]:
        for entered in step.happenings if step is not None else ():
            if isinstance(entered, Entered) and entered.execution.id == "new" and entered.state is not ExecutionState.RUNNING:
                return (("after start", skill.name, entered.result),)
        return ()

    def _broken_by_data(self, skill: Skill, situation: Situation) -> tuple[Key, ...]:
        """Find invariants that data may make false right after the start."""
        births = [birth for birth in self._births if birth.skill == skill.name and holds(birth.when, situation.states, {})]
        return tuple(("after start", skill.name, birth.invariant) for birth in births)


_KINDS = {
    Cause.EXTERN: StepKind.EXTERN,
    Cause.EVENT: StepKind.EVENT,
    Cause.START: StepKind.START,
    Cause.RESULT: StepKind.RESULT,
    Cause.INTERRUPT: StepKind.INTERRUPT,
    Cause.BREAK: StepKind.BREAK,
}
"""What counterexamples call the steps of the search."""


def _subject(stimulus: Stimulus) -> tuple[str, ...]:
    return tuple(name for name in (stimulus.execution.skill, stimulus.name, stimulus.target) if name)
