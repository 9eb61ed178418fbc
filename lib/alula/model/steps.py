"""Every step that a skillset can take: what can ask for one in a situation, and what ``semantics`` makes of it.

The proofs of skillsets and missions and the conformance of logs take their steps from here, and each leaves out what it does not look
at. Data and time are not followed, so both may go either way (see ``overapproximation``).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from enum import Enum
from typing import NamedTuple

from alula.model import semantics
from alula.model.conditions import NO_DATA, judge
from alula.model.execution_state import ExecutionState as S
from alula.model.expressions import Expression
from alula.model.model import Effect, Resource, Skill, Skillset
from alula.model.overapproximation import Breaker, OverApproximation
from alula.model.situation import Entered, Running, Situation, Step

PHASES = {S.RUNNING: (S.PAUSED, S.INTERRUPTING), S.PAUSED: (S.RUNNING, S.INTERRUPTING), S.INTERRUPTING: ()}
"""From which phase of a running execution to which others."""


class Cause(Enum):
    """What asks for a step; the value says it with the names of the stimulus."""

    EXTERN = "{name} is reported {target}"
    EVENT = "event {name}"
    REQUEST = "{execution} is requested"
    START = "{execution} starts"
    REFUSE = "{execution} is refused"
    REJECT = "{execution} is not validated"
    PHASE = "{execution} becomes {name}"
    RESULT = "{execution} ends with {name}"
    INTERRUPT = "{execution} is interrupted"
    FAIL = "{execution} fails"
    BREAK = "data or time break {name} of {execution}"
    DIE = "the managers end"

    __hash__ = object.__hash__  # there is one of each, and searches look it up at every step


class Stimulus(NamedTuple):
    """Something that asks for a step.

    Attributes:
        cause: what it is.
        name: the resource (EXTERN), event, precondition (REFUSE), phase, result, or invariant (BREAK).
        target: the state that a resource is taken to (EXTERN).
        execution: the one that it is about.
    """

    cause: Cause
    name: str = ""
    target: str = ""
    execution: Running = Running("", "")

    def __str__(self) -> str:
        called = f"{self.execution.skill} {self.execution.id}"
        return self.cause.value.format(name=self.name, target=self.target, execution=called)


class SkillOutcome(NamedTuple):
    """An outcome that an execution can be brought to: by RESULT, ``name``, or by INTERRUPT."""

    cause: Cause
    name: str
    effect: Effect
    postcondition: Expression


def outcomes_of(skill: Skill) -> tuple[SkillOutcome, ...]:
    """Return the outcomes that executions of a skill can be brought to: its results, in the model's order, and the interruption."""
    results = (SkillOutcome(Cause.RESULT, one.name, one.effect, one.postcondition) for one in skill.results)
    return (*results, SkillOutcome(Cause.INTERRUPT, "", skill.interrupt.effect, skill.interrupt.postcondition))


class PossibleSteps:
    """The steps of one skillset over resources alone."""

    def __init__(self, model: OverApproximation) -> None:
        self.skillset = model.skillset
        self._original = model.original
        self._ends = {s.name: [*((one.cause, one.name) for one in outcomes_of(s)), (Cause.FAIL, "")] for s in model.skillset.skills}
        self._breakers: dict[str, list[Breaker]] = {skill.name: [] for skill in model.skillset.skills}
        for breaker in model.breakers:
            self._breakers[breaker.skill].append(breaker)

    def of(self, situation: Situation, requested: Collection[Running] = ()) -> Iterator[Stimulus]:
        """Yield everything that can ask for a step, but for new requests and phases of the executions that run."""
        for execution in requested:
            yield from self.of_request(situation, execution)
        for execution in situation.running:
            yield from self.of_running(situation, execution)
        yield from self.of_outside(situation)
        yield Stimulus(Cause.DIE)

    def of_outside(self, situation: Situation) -> Iterator[Stimulus]:
        """Yield what is no execution's doing: transitions of the functional layer, and events."""
        for resource in self.skillset.resources:
            yield from self.of_resource(situation, resource)
        for event in self.skillset.events:
            yield from self.of_event(situation, event.name)

    def of_resource(self, situation: Situation, resource: Resource) -> Iterator[Stimulus]:
        """Yield the transitions of a resource that the functional layer may take."""
        for target in resource.targets(situation.states[resource.name], extern=True):
            yield Stimulus(Cause.EXTERN, resource.name, target)

    def of_event(self, situation: Situation, name: str) -> Iterator[Stimulus]:
        """Yield the event if it can be taken."""
        if not semantics.event_refusal(self.skillset, situation, name):
            yield Stimulus(Cause.EVENT, name)

    def of_request(self, situation: Situation, execution: Running) -> Iterator[Stimulus]:
        """Yield how a request can be answered: the first precondition that is false refuses it, and data may decide which one is."""
        yield Stimulus(Cause.REJECT, execution=execution)
        yield Stimulus(Cause.INTERRUPT, execution=execution)
        yield Stimulus(Cause.FAIL, execution=execution)
        for precondition in self._original.skill(execution.skill).preconditions:
            answer = judge(precondition.condition, situation.states, NO_DATA)
            if answer is not True:
                yield Stimulus(Cause.REFUSE, precondition.name, execution=execution)
            if answer is False:
                return
        yield from self.of_start(situation, execution)

    def of_start(self, situation: Situation, execution: Running) -> Iterator[Stimulus]:
        """Yield the start if the preconditions can be true; it is refused where its effect is no transition."""
        if all(judge(one.condition, situation.states, NO_DATA) for one in self.skillset.skill(execution.skill).preconditions):
            yield Stimulus(Cause.START, execution=execution)

    def of_phase(self, execution: Running, phase: S) -> Iterator[Stimulus]:
        """Yield the phases that a running execution can go to; the resources do not see them."""
        for other in PHASES[phase]:
            yield Stimulus(Cause.PHASE, other.value, execution=execution)

    def of_running(self, situation: Situation, execution: Running) -> Iterator[Stimulus]:
        """Yield how an execution can end."""
        for cause, name in self._ends[execution.skill]:
            yield Stimulus(cause, name, "", execution)
        for breaker in self._breakers[execution.skill]:
            if judge(breaker.when, situation.states, NO_DATA) is True:
                yield Stimulus(Cause.BREAK, breaker.invariant, execution=execution)


def take(skillset: Skillset, situation: Situation, stimulus: Stimulus) -> Step:
    """Take the step that a stimulus asks for, which is possible now."""
    cause, name, target, execution = stimulus
    match cause:
        case Cause.EXTERN:
            return semantics.transition(skillset, situation, name, target)
        case Cause.EVENT:
            return semantics.event(skillset, situation, name)
        case Cause.START:
            return semantics.start(skillset, situation, execution)
        case Cause.RESULT:
            return semantics.terminate(skillset, situation, execution, name)
        case Cause.BREAK:
            return semantics.lose(skillset, situation, execution, name)
        case Cause.DIE:
            return Step(semantics.initial(skillset), tuple(Entered(one, S.FAILED) for one in situation.running))
        case Cause.INTERRUPT if execution in situation.running:
            return semantics.interrupt(skillset, situation, execution)
        case Cause.FAIL if execution in situation.running:
            return semantics.fail(skillset, situation, execution, "")
        case _:
            return Step(situation, (_entered(stimulus),))


_ENTERED = {
    Cause.REQUEST: S.REQUESTED,
    Cause.REFUSE: S.NOT_READY,
    Cause.REJECT: S.NOT_VALIDATED,
    Cause.INTERRUPT: S.INTERRUPTED,
    Cause.FAIL: S.FAILED,
}


def _entered(stimulus: Stimulus) -> Entered:
    """Return the state of an execution that only itself changes."""
    if stimulus.cause is Cause.PHASE:
        return Entered(stimulus.execution, S(stimulus.name))
    return Entered(stimulus.execution, _ENTERED[stimulus.cause], stimulus.name)
