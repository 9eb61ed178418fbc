"""What can happen in the managers of one skillset: each step is taken by ``alula.model.semantics``, which the managers execute."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from alula.language.outside import opened, untaken
from alula.model import semantics
from alula.model.breaking import breaks
from alula.model.conditions import data_of, judge, whatever_the_data
from alula.model.execution_state import ExecutionState
from alula.model.model import ResultKind, Skill, Skillset
from alula.model.situation import Change, Entered, Running, Situation, Step
from alula.prove.limits import Deadline
from alula.prove.mission.state import Ending, Event, Execution, Kind, Managers
from alula.prove.skillset.abstract import Abstraction, Breaker, without_data

NOT_VALIDATED = ExecutionState.NOT_VALIDATED.value
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


def searched(skillset: Skillset, deadline: Deadline) -> Abstraction:
    """Return a skillset as it is searched: without data, and with arrows that nothing in the model takes as extern ones.

    Its preconditions keep their names; data that make one false refuse in a step of their own.
    """
    abstraction = without_data(opened(skillset, untaken(skillset)), deadline)
    skills = tuple(map(_named, abstraction.original.skills, abstraction.skillset.skills))
    return replace(abstraction, skillset=replace(abstraction.skillset, skills=skills))


class ManagersSteps:
    """The steps of one skillset.

    ``skills`` are the leaves' skills by the leaves' numbers, of this skillset only; ``told`` says of an execution's end what the tree can
    tell of it.
    """

    def __init__(
        self, skillset: Skillset, skills: Mapping[int, str], failures: Failures, deadline: Deadline, told: Callable[[int, End], End]
    ) -> None:
        abstraction = searched(skillset, deadline)
        self.model = abstraction.original
        self.skills = skills
        self._failures = failures
        self._told_end = told
        self._skillset = abstraction.skillset
        self._breakers = _breakers_of(abstraction)
        self._names = tuple(resource.name for resource in self.model.resources)
        self._bad = {
            (resource.name, arrow.source, arrow.target)
            for resource in self.model.resources
            for arrow in resource.transitions
            if arrow.extern and breaks(self.model, resource, arrow)
        }

    def initial(self) -> Managers:
        """Return them at power-up."""
        return self._managers(semantics.initial(self._skillset), ())

    def moves(self, managers: Managers) -> Iterator[tuple[Event, Managers]]:
        """Yield each thing that can happen in them or to them."""
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
        yield from self._extern(managers, situation)
        yield from self._events(managers, situation)
        if self._failures.deaths:
            yield self._death(managers)

    def resource(self, managers: Managers, name: str) -> str | None:
        """Return the state of a resource, None where they have died."""
        return None if managers.states is None else managers.states[self._names.index(name)]

    # --- steps -------------------------------------------------------------------------------------------------------

    def _arrivals(self, managers: Managers, situation: Situation, execution: Execution) -> Iterator[tuple[Event, Managers]]:
        name = self.skills[execution.leaf]
        skill = self._skillset.skill(name)
        if execution.asked:
            state = ExecutionState.INTERRUPTED.value
            ended = self._ended(execution, state)
            yield (
                self._event(Kind.INTERRUPT, execution, ended=(self._ending(execution, state),)),
                _with(managers, execution, ended),
            )
        step = semantics.start(self._skillset, situation, Running(str(execution.leaf), name))
        refused = next((one for one in step.happenings if isinstance(one, Entered) and one.state is ExecutionState.NOT_READY), None)
        if refused is not None:
            yield self._refused(managers, execution, ExecutionState.NOT_READY.value, refused.result)
        else:
            yield self._event(Kind.START, execution, step), self._after(managers, step)
        for precondition in self.model.skill(name).preconditions:
            if any(data_of(precondition.condition)) and judge(precondition.condition, situation.states, {}) is not True:
                yield self._refused(managers, execution, ExecutionState.NOT_READY.value, precondition.name, failure=True)
        if self._failures.refusals and skill.inputs:
            yield self._refused(managers, execution, NOT_VALIDATED, "", failure=True)

    def _refused(
        self, managers: Managers, execution: Execution, state: str, result: str, *, failure: bool = False
    ) -> tuple[Event, Managers]:
        ended = self._ended(execution, state, result)
        event = self._event(
            Kind.REFUSE, execution, ended=(self._ending(execution, state, result),), result=result, state=state, failure=failure
        )
        return event, _with(managers, execution, ended)

    def _ends(self, managers: Managers, situation: Situation, execution: Execution) -> Iterator[tuple[Event, Managers]]:
        running = Running(str(execution.leaf), self.skills[execution.leaf])
        skill = self._skillset.skill(running.skill)
        for result in skill.results:
            step = semantics.terminate(self._skillset, situation, running, result.name)
            failure = skill.kind_of(result.name) is not ResultKind.SUCCESS
            yield self._event(Kind.RESULT, execution, step, result=result.name, failure=failure), self._after(managers, step)
        if execution.asked:
            step = semantics.interrupt(self._skillset, situation, running)
            yield self._event(Kind.INTERRUPT, execution, step), self._after(managers, step)
        for breaker in self._breakers.get(skill.name, ()):
            if judge(breaker.when, situation.states, {}) is True:
                step = semantics.lose(self._skillset, situation, running, breaker.invariant)
                yield self._event(Kind.BREAK, execution, step, result=breaker.invariant, failure=True), self._after(managers, step)
        if self._failures.hooks:
            step = semantics.fail(self._skillset, situation, running, "")
            yield self._event(Kind.FAIL, execution, step, failure=True), self._after(managers, step)
        if self._failures.pauses and not execution.asked:
            step = semantics.interrupt(self._skillset, situation, running)
            yield self._event(Kind.PAUSE, execution, step, failure=True), self._after(managers, step)

    def _death(self, managers: Managers) -> tuple[Event, Managers]:
        state = ExecutionState.FAILED.value
        known = [one if one.phase == ENDED else self._ended(one, state) for one in managers.executions if not one.left]
        ended = tuple(self._ending(one, state) for one in managers.executions if one.phase != ENDED)
        return Event(Kind.DIE, self.model.name, failure=True, ended=ended), Managers(None, _ordered(known))

    def _extern(self, managers: Managers, situation: Situation) -> Iterator[tuple[Event, Managers]]:
        for resource in self._skillset.resources:
            source = situation.states[resource.name]
            for target in resource.targets(source, extern=True):
                step = semantics.transition(self._skillset, situation, resource.name, target)
                bad = (resource.name, source, target) in self._bad
                event = Event(Kind.EXTERN, self.model.name, resource.name, target, source=source, failure=bad)
                yield self._told(event, step), self._after(managers, step)

    def _events(self, managers: Managers, situation: Situation) -> Iterator[tuple[Event, Managers]]:
        for event in self._skillset.events:
            if event.effect.assignments and not semantics.event_refusal(self._skillset, situation, event.name):
                step = semantics.event(self._skillset, situation, event.name)
                yield self._told(Event(Kind.EVENT, self.model.name, event.name), step), self._after(managers, step)

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


def _named(skill: Skill, abstract: Skill) -> Skill:
    """Return the abstract skill with the preconditions of the skill, each of which some data fulfil."""
    kept = tuple(
        replace(one, condition=whatever_the_data(one.condition, unknown=True)) if any(data_of(one.condition)) else one
        for one in skill.preconditions
    )
    return replace(abstract, preconditions=kept)


def _breakers_of(abstraction: Abstraction) -> dict[str, list[Breaker]]:
    found: dict[str, list[Breaker]] = {}
    for breaker in abstraction.breakers:
        found.setdefault(breaker.skill, []).append(breaker)
    return found
