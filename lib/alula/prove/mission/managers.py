"""List the steps of one skillset's managers in a mission's search: those of ``alula.model.steps``, deaths and restarts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from alula.language.outside import opened, untaken
from alula.model import semantics
from alula.model.breaking import breaks
from alula.model.conditions import NO_DATA, judge
from alula.model.execution_state import ExecutionState
from alula.model.model import ResultKind, Skillset
from alula.model.overapproximation import OverApproximation, over_approximate
from alula.model.situation import Change, Entered, Running, Situation, Step
from alula.model.steps import Cause, PossibleSteps, Stimulus, take
from alula.prove.mission.state import Ending, Event, Execution, Kind, Managers

NOT_VALIDATED, NOT_READY = ExecutionState.NOT_VALIDATED.value, ExecutionState.NOT_READY.value
INTERRUPTED = ExecutionState.INTERRUPTED.value
End = tuple[str, str]
"""State and result of an execution that has ended."""
SENT, RUNNING, ENDED = "sent", "running", "ended"


@dataclass(frozen=True)
class Failures:
    """Which failures are looked at besides those of the models: what hooks and processes may do at any time.

    Attributes:
        refusals: hooks may refuse inputs (NOT_VALIDATED).
        hooks: hooks may fail (FAILED).
        deaths: managers' processes may end, and come back.
        aborts: someone may abort the mission.
        pauses: someone may pause the mission; what does not go on afterwards is interrupted, which the tree has not asked for.
    """

    refusals: bool = True
    hooks: bool = True
    deaths: bool = False
    aborts: bool = True
    pauses: bool = False


def searched(skillset: Skillset) -> OverApproximation:
    """Return a skillset as it is searched: over resources alone, and with transitions that nothing in the model takes as extern ones."""
    return over_approximate(opened(skillset, untaken(skillset)))


class ManagersSteps:
    """The steps of one skillset's managers.

    ``skills`` are the leaves' skills by the leaves' numbers, of this skillset only; ``told`` says of an execution's end what the tree can
    tell of it.
    """

    def __init__(self, skillset: Skillset, skills: Mapping[int, str], failures: Failures, told: Callable[[int, End], End]) -> None:
        searchable = searched(skillset)
        self.model = searchable.original
        self.skills = skills
        self._failures = failures
        self._told_end = told
        self._skillset = searchable.skillset
        self._possible = PossibleSteps(searchable)
        self._names = tuple(resource.name for resource in self.model.resources)
        self._bad = {
            (resource.name, transition.source, transition.target)
            for resource in self.model.resources
            for transition in resource.transitions
            if transition.extern and breaks(self.model, resource, transition)
        }

    def initial(self) -> Managers:
        """Return the managers at power-up."""
        return self._managers(semantics.initial(self._skillset), ())

    def moves(self, managers: Managers) -> Iterator[tuple[Event, Managers]]:
        """Yield each event that is possible in the managers, with the managers after it."""
        if managers.states is None:
            if self._failures.deaths:
                yield Event(Kind.RESTART, self.model.name), Managers(self.initial().states, managers.executions)
            return
        situation = self._situation(managers)
        for execution in managers.executions:
            if execution.phase == SENT:
                yield from self._arrivals(managers, situation, execution)
            elif execution.phase == RUNNING:
                yield from self._ends(managers, situation, execution)
        yield from self._outside(managers, situation)
        if self._failures.deaths:
            yield self._death(managers)

    def resource(self, managers: Managers, name: str) -> str | None:
        """Return the state of a resource, None where they have died."""
        return None if managers.states is None else managers.states[self._names.index(name)]

    # --- steps -------------------------------------------------------------------------------------------------------

    def _arrivals(self, managers: Managers, situation: Situation, execution: Execution) -> Iterator[tuple[Event, Managers]]:
        """Yield what becomes of a request; data that make a precondition false are a failure."""
        name = self.skills[execution.leaf]
        preconditions = {one.name: one.condition for one in self.model.skill(name).preconditions}
        for stimulus in self._possible.of_request(situation, Running(str(execution.leaf), name)):
            match stimulus.cause:
                case Cause.INTERRUPT if execution.asked:
                    ended = (self._ending(execution, INTERRUPTED),)
                    yield (
                        self._event(Kind.INTERRUPT, execution, ended=ended),
                        _with(managers, execution, self._ended(execution, INTERRUPTED)),
                    )
                case Cause.REJECT if self._failures.refusals and self.model.skill(name).inputs:
                    yield self._refused(managers, execution, NOT_VALIDATED, "", failure=True)
                case Cause.REFUSE:
                    failure = judge(preconditions[stimulus.name], situation.states, NO_DATA) is not False
                    yield self._refused(managers, execution, NOT_READY, stimulus.name, failure=failure)
                case Cause.START:
                    yield self._started(managers, situation, execution, stimulus)

    def _started(self, managers: Managers, situation: Situation, execution: Execution, stimulus: Stimulus) -> tuple[Event, Managers]:
        step = take(self._skillset, situation, stimulus)
        if any(isinstance(one, Entered) and one.state is ExecutionState.NOT_READY for one in step.happenings):
            return self._refused(managers, execution, NOT_READY, "")  # its effect is no transition
        return self._event(Kind.START, execution, step), self._after(managers, step)

    def _refused(
        self, managers: Managers, execution: Execution, state: str, result: str, *, failure: bool = False
    ) -> tuple[Event, Managers]:
        ended = self._ended(execution, state, result)
        event = self._event(
            Kind.REFUSE, execution, ended=(self._ending(execution, state, result),), result=result, state=state, failure=failure
        )
        return event, _with(managers, execution, ended)

    def _ends(self, managers: Managers, situation: Situation, execution: Execution) -> Iterator[tuple[Event, Managers]]:
        skill = self._skillset.skill(self.skills[execution.leaf])
        for stimulus in self._possible.of_running(situation, Running(str(execution.leaf), skill.name)):
            kind = self._kind_of_end(stimulus, execution)
            if kind is not None:
                step = take(self._skillset, situation, stimulus)
                failure = kind is not Kind.INTERRUPT and (kind is not Kind.RESULT or skill.kind_of(stimulus.name) is not ResultKind.SUCCESS)
                yield self._event(kind, execution, step, result=stimulus.name, failure=failure), self._after(managers, step)

    def _kind_of_end(self, stimulus: Stimulus, execution: Execution) -> Kind | None:
        """Return what such an end of an execution is called, None where it is not looked at."""
        match stimulus.cause:
            case Cause.INTERRUPT if not execution.asked:
                return Kind.PAUSE if self._failures.pauses else None
            case Cause.FAIL if not self._failures.hooks:
                return None
            case cause:
                return _ENDS[cause]

    def _death(self, managers: Managers) -> tuple[Event, Managers]:
        state = ExecutionState.FAILED.value
        known = [one if one.phase == ENDED else self._ended(one, state) for one in managers.executions if not one.left]
        ended = tuple(self._ending(one, state) for one in managers.executions if one.phase != ENDED)
        return Event(Kind.DIE, self.model.name, failure=True, ended=ended), Managers(None, _ordered(known))

    def _outside(self, managers: Managers, situation: Situation) -> Iterator[tuple[Event, Managers]]:
        for stimulus in self._possible.of_outside(situation):
            name, target = stimulus.name, stimulus.target
            if stimulus.cause is Cause.EXTERN:
                source = situation.states[name]
                bad = (name, source, target) in self._bad
                event = Event(Kind.EXTERN, self.model.name, name, target, source=source, failure=bad)
            elif any(one.name == name and one.effect.assignments for one in self._skillset.events):
                event = Event(Kind.EVENT, self.model.name, name)
            else:
                continue
            step = take(self._skillset, situation, stimulus)
            yield self._told(event, step), self._after(managers, step)

    # --- values ------------------------------------------------------------------------------------------------------

    def _situation(self, managers: Managers) -> Situation:
        running = tuple(Running(str(one.leaf), self.skills[one.leaf]) for one in managers.executions if one.phase == RUNNING)
        return Situation(dict(zip(self._names, managers.states or (), strict=True)), running)

    def _managers(self, situation: Situation, others: tuple[Execution, ...]) -> Managers:
        return Managers(tuple(situation.states[name] for name in self._names), others)

    def _after(self, managers: Managers, step: Step) -> Managers:
        """Return them after a step: executions that run now, then those that do not."""
        known = {one.leaf: one for one in managers.executions}
        for ending in self._endings(step):
            one = known.pop(ending.leaf)
            known |= {} if one.left else {ending.leaf: self._ended(one, ending.state, ending.result)}
        running = tuple(known.pop(int(one.id))._replace(phase=RUNNING) for one in step.situation.running)
        return self._managers(step.situation, (*running, *_ordered(known.values())))

    def _event(
        self,
        kind: Kind,
        execution: Execution,
        step: Step | None = None,
        *,
        ended: tuple[Ending, ...] = (),
        result: str = "",
        state: str = "",
        failure: bool = False,
    ) -> Event:
        name = self.skills[execution.leaf]
        event = Event(kind, self.model.name, name, result, state, leaf=execution.leaf, failure=failure, ended=ended)
        return event if step is None else self._told(event, step)

    def _told(self, event: Event, step: Step) -> Event:
        changes = tuple((one.resource, one.source, one.target) for one in step.happenings if isinstance(one, Change))
        return event._replace(ended=(*event.ended, *self._endings(step)), changes=changes)

    @staticmethod
    def _endings(step: Step) -> tuple[Ending, ...]:
        entered = [one for one in step.happenings if isinstance(one, Entered) and one.state.terminal]
        return tuple(Ending(int(one.execution.id), one.execution.skill, one.state.value, one.result) for one in entered)

    def _ended(self, execution: Execution, state: str, result: str = "") -> Execution:
        state, result = self._told_end(execution.leaf, (state, result))
        return execution._replace(phase=ENDED, asked=False, state=state, result=result)

    def _ending(self, execution: Execution, state: str, result: str = "") -> Ending:
        return Ending(execution.leaf, self.skills[execution.leaf], state, result)


def _ordered(executions: Iterable[Execution]) -> tuple[Execution, ...]:
    return tuple(sorted(executions))


def _with(managers: Managers, execution: Execution, ended: Execution) -> Managers:
    running = [one for one in managers.executions if one.phase == RUNNING]
    others = [one for one in managers.executions if one.phase != RUNNING and one != execution]
    others += [] if execution.left else [ended]
    return Managers(managers.states, (*running, *_ordered(others)))


_ENDS = {Cause.RESULT: Kind.RESULT, Cause.INTERRUPT: Kind.INTERRUPT, Cause.FAIL: Kind.FAIL, Cause.BREAK: Kind.BREAK}
