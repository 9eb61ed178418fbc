"""The steps of ``alula.model.steps`` that a log can have: values of data and the time between events are not in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from alula.model import semantics
from alula.model.deadlines import nanoseconds, waits
from alula.model.execution_state import ExecutionState as S
from alula.model.model import Invariant, Skillset
from alula.model.overapproximation import over_approximate
from alula.model.situation import Running, Situation
from alula.model.steps import Cause, PossibleSteps, Stimulus, take
from alula.records.conformance.beliefs import Belief, Happening
from alula.runtime.core.events import EngineEvent, TransitionEvent

_EVENT = "event "


@dataclass(frozen=True)
class Possible:
    """A step that may be taken now."""

    stimulus: Stimulus
    situation: Situation
    happenings: tuple[Happening, ...]


class LoggedSteps:
    """The steps of one skillset.

    Raises:
        UnsupportedModelError: the model can't be executed.
    """

    def __init__(self, skillset: Skillset) -> None:
        semantics.check_supported(skillset)
        self.skillset = skillset
        self._possible = PossibleSteps(over_approximate(skillset))

    def of(self, belief: Belief, event: EngineEvent) -> Iterator[Possible]:
        """Yield the steps that could have an event of this subject in them, not only at their beginning."""
        yield from self._taken(belief, self._stimuli(belief, event))

    def possible(self, belief: Belief) -> Iterator[Possible]:
        """Yield every step that may be taken now, but for new requests."""
        for execution in belief.open:
            yield from self._taken(belief, self._of_open(belief, execution))
        yield from self._taken(belief, self._possible.of_outside(belief.situation))

    def _taken(self, belief: Belief, stimuli: Iterable[Stimulus]) -> Iterator[Possible]:
        for stimulus in stimuli:
            step = take(self._possible.skillset, belief.situation, stimulus)
            yield Possible(stimulus, step.situation, step.happenings)

    def _stimuli(self, belief: Belief, event: EngineEvent) -> Iterator[Stimulus]:
        if not isinstance(event, TransitionEvent):
            yield from self._of_execution(belief, Running(event.id, event.skill), event.state)
        elif event.cause == semantics.EXTERN:
            if not semantics.extern_refusal(self.skillset, belief.situation, event.resource, event.to_state):
                yield Stimulus(Cause.EXTERN, event.resource, event.to_state)
        elif event.cause.startswith(_EVENT):
            yield from self._possible.of_event(belief.situation, event.cause.removeprefix(_EVENT))
        else:
            skill, _, rest = event.cause.partition(" ")
            yield from self._of_open(belief, Running(rest.partition(" ")[0], skill))

    def _of_execution(self, belief: Belief, execution: Running, state: S) -> Iterator[Stimulus]:
        yield from self._of_open(belief, execution)
        if state is S.REQUESTED and belief.execution(execution.id) is None and execution.skill in self.skillset.skill_index:
            yield Stimulus(Cause.REQUEST, execution=execution)

    def _of_open(self, belief: Belief, execution: Running) -> Iterator[Stimulus]:
        """Yield everything that can happen to an execution now, if it is open."""
        phase = belief.open.get(execution)
        if phase is S.REQUESTED:
            yield from self._possible.of_request(belief.situation, execution)
        elif phase is not None:
            yield from self._possible.of_phase(execution, phase)
            for stimulus in self._possible.of_running(belief.situation, execution):
                if self._in_time(belief, stimulus) and (phase is S.INTERRUPTING or stimulus.cause is not Cause.INTERRUPT):
                    yield stimulus

    def _in_time(self, belief: Belief, stimulus: Stimulus) -> bool:
        """Return whether an invariant can have been false for as long as it may."""
        invariant = self._invariant(stimulus) if stimulus.cause is Cause.BREAK else None
        if invariant is None or invariant.hold is None or not waits(invariant):
            return True
        since_ns = belief.since_ns.get((stimulus.execution, invariant.name))
        return since_ns is not None and belief.situation.now_ns >= since_ns + nanoseconds(invariant.hold.for_s)

    def watched(self, belief: Belief) -> dict[tuple[Running, str], int]:
        """Return ``since_ns`` after a step."""
        broken = (one for execution in belief.situation.running for one in self._possible.of_running(belief.situation, execution))
        keys = ((one.execution, one.name) for one in broken if one.cause is Cause.BREAK and waits(self._invariant(one)))
        return {key: belief.since_ns.get(key, belief.earliest_ns) for key in keys}

    def _invariant(self, stimulus: Stimulus) -> Invariant:
        invariants = self.skillset.skill(stimulus.execution.skill).invariants
        return next(one for one in invariants if one.name == stimulus.name)
