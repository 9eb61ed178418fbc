"""The steps that the semantics allows, as far as a log can tell: values of data and the time between events are not in it.

What data or time decide may go either way: a precondition over data may hold or not, and an invariant over data, or one that may be
false for a while, may be broken by a step of its own. Everything else is decided by the runtime's own ``alula.model.semantics``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from alula.model import semantics
from alula.model.conditions import NO_DATA, judge, whatever_the_data
from alula.model.deadlines import nanoseconds, waits
from alula.model.execution_state import ExecutionState as S
from alula.model.expressions import TRUE
from alula.model.model import Invariant, Precondition, Skill, Skillset
from alula.model.situation import Entered, Running, Situation, Step
from alula.records.conformance.beliefs import Ask, Belief, Happening, Stimulus
from alula.runtime.core.events import EngineEvent, TransitionEvent

PHASES = {S.RUNNING: frozenset({S.PAUSED, S.INTERRUPTING}), S.PAUSED: frozenset({S.RUNNING, S.INTERRUPTING}), S.INTERRUPTING: frozenset()}
"""From which phase of a running execution to which others."""
ENDS_OF_REQUESTS = frozenset({S.NOT_VALIDATED, S.INTERRUPTED, S.FAILED})
"""How a request can end that the model has not refused."""
_EVENT = "event "


@dataclass(frozen=True)
class Possible:
    """A step that may be taken now."""

    stimulus: Stimulus
    situation: Situation
    happenings: tuple[Happening, ...]


class PossibleSteps:
    """The steps of one skillset.

    Raises:
        UnsupportedModelError: the model can't be executed.
    """

    def __init__(self, skillset: Skillset) -> None:
        semantics.check_supported(skillset)
        self.skillset = skillset
        self._resources_only = replace(skillset, skills=tuple(map(_whatever_data, skillset.skills)))

    def of(self, belief: Belief, event: EngineEvent) -> Iterator[Possible]:
        """Yield the steps that could have an event of this subject in them, not only at their beginning."""
        if not isinstance(event, TransitionEvent):
            yield from self._of_execution(belief, Running(event.id, event.skill), event.state)
        elif event.cause == semantics.EXTERN:
            if not semantics.extern_refusal(self.skillset, belief.situation, event.resource, event.to_state):
                step = semantics.transition(self._resources_only, belief.situation, event.resource, event.to_state)
                yield _possible(Stimulus(Ask.EXTERN, (event.resource, event.to_state)), step)
        elif event.cause.startswith(_EVENT):
            name = event.cause.removeprefix(_EVENT)
            if not semantics.event_refusal(self.skillset, belief.situation, name):
                yield _possible(Stimulus(Ask.EVENT, (name,)), semantics.event(self._resources_only, belief.situation, name))
        else:
            skill, _, rest = event.cause.partition(" ")
            execution = Running(rest.partition(" ")[0], skill)
            if execution in belief.open:
                yield from self._of_open(belief, execution)

    def _of_execution(self, belief: Belief, execution: Running, state: S) -> Iterator[Possible]:
        if execution in belief.open:
            yield from self._of_open(belief, execution)
        elif state is S.REQUESTED and belief.execution(execution.id) is None and execution.skill in self.skillset.skill_index:
            yield _entered(belief, execution, S.REQUESTED, Ask.REQUEST)

    def _of_open(self, belief: Belief, execution: Running) -> Iterator[Possible]:
        """Yield everything that can happen to an open execution now."""
        phase = belief.open[execution]
        if phase is S.REQUESTED:
            yield from self._starts(belief, execution)
            for end in ENDS_OF_REQUESTS:
                yield _entered(belief, execution, end)
            return
        for other in PHASES[phase]:
            yield _entered(belief, execution, other)
        yield from self._ends(belief, execution, phase)
        for invariant in self.breakable(belief, execution):
            step = semantics.lose(self._resources_only, belief.situation, execution, invariant.name)
            yield _possible(_about(Ask.BREAK, execution, invariant.name), step)

    def _starts(self, belief: Belief, execution: Running) -> Iterator[Possible]:
        """Yield the start, and each refusal by a precondition that data may decide, or that resources do."""
        situation = belief.situation
        for precondition in self.skillset.skill(execution.skill).preconditions:
            answer = judge(precondition.condition, situation.states, NO_DATA)
            if answer is not True:
                refused = Entered(execution, S.NOT_READY, precondition.name)
                yield Possible(_about(Ask.REFUSE, execution), situation, (refused,))
            if answer is False:
                return
        yield _possible(_about(Ask.START, execution), semantics.start(self._resources_only, situation, execution))

    def _ends(self, belief: Belief, execution: Running, phase: S) -> Iterator[Possible]:
        model, situation = self._resources_only, belief.situation
        for result in model.skill(execution.skill).results:
            step = semantics.terminate(model, situation, execution, result.name)
            yield _possible(_about(Ask.RESULT, execution, result.name), step)
        if phase is S.INTERRUPTING:
            yield _possible(_about(Ask.INTERRUPTED, execution), semantics.interrupt(model, situation, execution))
        yield _possible(_about(Ask.FAIL, execution), semantics.fail(model, situation, execution, ""))

    def breakable(self, belief: Belief, execution: Running) -> Iterator[Invariant]:
        """Yield the invariants of a running execution that data or time may have broken by now."""
        for invariant in self.skillset.skill(execution.skill).invariants:
            since_ns = belief.since_ns.get((execution, invariant.name))
            if not waits(invariant):
                broken = may_be_bad(invariant, belief.situation)
            else:
                for_s = 0.0 if invariant.hold is None else invariant.hold.for_s
                broken = since_ns is not None and belief.situation.now_ns >= since_ns + nanoseconds(for_s)
            if broken:
                yield invariant

    def watched(self, belief: Belief) -> dict[tuple[Running, str], int]:
        """Return ``since_ns`` after a step."""
        return {
            key: belief.since_ns.get(key, belief.earliest_ns)
            for execution in belief.situation.running
            for invariant in self.skillset.skill(execution.skill).invariants
            if waits(invariant) and may_be_bad(invariant, belief.situation)
            for key in [(execution, invariant.name)]
        }


def may_be_bad(invariant: Invariant, situation: Situation) -> bool:
    """Tell whether some data make the invariant count as false; one that has to recover may, whatever the resources are."""
    recovers = invariant.hold is not None and invariant.hold.hysteresis is not None
    return recovers or judge(invariant.condition, situation.states, NO_DATA) is not True


def _whatever_data(skill: Skill) -> Skill:
    """Return the skill with only those refusals, violations and failures that no data and no time could avert."""
    preconditions = tuple(Precondition(p.name, whatever_the_data(p.condition, unknown=True)) for p in skill.preconditions)
    invariants = tuple(
        replace(one, condition=TRUE if waits(one) else whatever_the_data(one.condition, unknown=True), hold=None)
        for one in skill.invariants
    )
    progress = None if skill.progress is None else replace(skill.progress, deadline_s=None)
    return replace(skill, preconditions=preconditions, invariants=invariants, progress=progress)


def _possible(stimulus: Stimulus, step: Step) -> Possible:
    return Possible(stimulus, step.situation, step.happenings)


def _about(ask: Ask, execution: Running, *names: str) -> Stimulus:
    return Stimulus(ask, (execution.skill, execution.id, *names))


def _entered(belief: Belief, execution: Running, state: S, ask: Ask = Ask.PHASE) -> Possible:
    """Return the step that changes nothing but the state of one execution."""
    return Possible(_about(ask, execution, state.value), belief.situation, (Entered(execution, state),))
