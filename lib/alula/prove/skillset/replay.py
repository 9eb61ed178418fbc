"""Replay a counterexample on the skillset as it is written: with data, time, and numbered executions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from alula.language.counterexamples import (
    CounterexampleEnd,
    CounterexampleStep,
    NumberedExecution,
    Path,
    StateChange,
    StepKind,
    Value,
    Values,
    messages,
)
from alula.model import semantics
from alula.model.conditions import judge
from alula.model.deadlines import nanoseconds, waits
from alula.model.execution_state import ExecutionState
from alula.model.expressions import Expression, Not
from alula.model.model import Invariant, Skill
from alula.model.situation import Change, Entered, Running, Situation, Step
from alula.model.steps import take
from alula.prove.skillset import words
from alula.prove.skillset.steps import Key, Move, State, TransitionSystem
from alula.prove.skillset.witness import States, Wish, Witness, data_atoms, fallen


class _NoValuesError(Exception):
    """No values of data take this step as the search took it."""


class Replay:
    """Takes the steps of a way from the first state, and keeps the steps of its counterexample.

    The search's executions have their place in its state for a name; here they are numbered by the starts of their skill.
    Steps are taken with data as long as values are found that take them as the search did, and as the search did from then on.
    """

    def __init__(self, system: TransitionSystem, first: State) -> None:
        self._system = system
        self._skillset = system.abstraction.original
        self._witness = Witness(self._skillset, system.abstraction.solver)
        self._numbers: Counter[str] = Counter()
        self._running: list[Running] = []
        """In the order of the search's state."""
        self._values: Mapping[Path, Value] = {}
        self._situation = semantics.initial(self._skillset)
        self._with_data = True
        self._states: States = system.situation(first).states
        told = ", ".join(f"{name} == {state}" for name, state in self._states.items())
        self.steps: list[CounterexampleStep] = []
        self._add(StepKind.INITIALLY, f"initially {told or 'nothing runs'}")

    def take(self, move: Move, fault: Key = (), *, loop: bool = False) -> None:
        """Take a step; ``fault`` is the fault that the last step shows, if any."""
        begun, situation, values = len(self.steps), self._situation, self._values
        if move.kind is StepKind.START and move.step is not None:
            self._numbers[move.subject[0]] += 1
        names = self._names(move)
        try:
            self._take_with_data(move, names, fault)
        except _NoValuesError:
            del self.steps[begun:]
            self._with_data, self._situation, self._values = False, situation, values
            self._take_as_searched(move, names)
        if move.step is not None:
            left = [names[one.id] for one in move.step.situation.running]
            alive = set(self._situation.running) if self._with_data else set(left)
            self._running = self._system.in_order([one for one in left if one in alive])
            self._states = self._situation.states if self._with_data else self._system.situation(move.target).states
        self._finish(begun, loop=loop)

    def _names(self, move: Move) -> dict[str, Running]:
        """Return each execution by the name that the search gives it in this step."""
        names = {str(place): execution for place, execution in enumerate(self._running, 1)}
        if move.kind is StepKind.START:
            skill = move.subject[0]
            number = self._numbers[skill] + (1 if move.step is None else 0)
            names["new"] = Running(f"{skill}-{number}", skill)
        return names

    def _finish(self, begun: int, *, loop: bool) -> None:
        """Note at the last line of a step what is the case after it."""
        running = [self._execution(one) for one in self._running]
        last = replace(self.steps[-1], states=tuple(self._states.items()), running=tuple(running))
        self.steps[-1] = last
        self.steps[begun:] = [replace(step, loop=loop) for step in self.steps[begun:]]

    # --- with data and time ---------------------------------------------------------------------------------------

    def _take_with_data(self, move: Move, names: Mapping[str, Running], fault: Key) -> None:
        if not self._with_data:
            raise _NoValuesError
        if move.kind is StepKind.BREAK:
            self._break(move, names)
            if self._differs(move, self._situation):
                raise _NoValuesError
            return
        broken = self._broken_at_birth(fault)
        if broken is not None:
            self._born_broken(move, names, broken)
        else:
            self._fulfil(move, names)
        if move.step is None:
            self._tell(move, None, names)
            return
        step = self._step(move, names)
        # A birth that data break ends at once; the search leaves that to a step of its own, which no counterexample goes on to.
        if broken is None and self._differs(move, step.situation):
            raise _NoValuesError
        self._tell(move, step, names)
        self._situation = step.situation

    def _step(self, move: Move, names: Mapping[str, Running]) -> Step:
        stimulus = move.stimulus
        acting = names.get(stimulus.execution.id, stimulus.execution)
        return take(self._skillset, self._situation, stimulus._replace(execution=acting))

    def _differs(self, move: Move, situation: Situation) -> bool:
        states = self._system.situation(move.target).states
        running = sorted(execution.skill for execution in situation.running)
        return dict(situation.states) != dict(states) or running != sorted(move.target.running)

    def _fulfil(self, move: Move, names: Mapping[str, Running]) -> None:
        """Have data fulfil what the step needs, by a step before it; invariants that may wait are fulfilled if that can be."""
        for waiting in (True, False):
            wishes = [*self._ready(move), *self._kept(move, names, waiting=waiting)]
            if all(judge(wish.condition, wish.states, self._situation.data) is True for wish in wishes):
                return
            values = self._witness.values(wishes)
            if values is not None:
                self._receive(values)
                return
        raise _NoValuesError

    def _receive(self, values: Values, *, quietly: bool = True) -> None:
        """Take values of data as a step of their own, which nothing that runs may mind if it is to be quiet."""
        known = {**self._values, **values}
        data = {path[0] for path in values}
        step = Step(self._situation)
        for name, message in messages({path: value for path, value in known.items() if path[0] in data}).items():
            step = self._following(step, semantics.receive(self._skillset, step.situation, name, message))
        if quietly and step.happenings:
            raise _NoValuesError
        self._values, self._situation = known, step.situation
        text = words.data_text(values) + words.violations(step, self._name)
        self._add(StepKind.DATA, text, step=step, data=tuple(sorted(values.items())))

    def _lose(self, data: Sequence[str]) -> None:
        """Have data get lost: there is no fresh value any more."""
        step = Step(self._situation)
        for name in data:
            step = self._following(step, semantics.receive(self._skillset, step.situation, name, None))
        self._values = {path: value for path, value in self._values.items() if path[0] not in data}
        self._situation = step.situation
        text = f"{', '.join(data)} {'has' if len(data) == 1 else 'have'} no fresh value{words.violations(step, self._name)}"
        self._add(StepKind.DATA, text, step=step, data=tuple(((name,), None) for name in data))

    @staticmethod
    def _following(step: Step, following: Step) -> Step:
        return Step(following.situation, (*step.happenings, *following.happenings))

    def _break(self, move: Move, names: Mapping[str, Running]) -> None:
        """Have data or time break an invariant of a running execution."""
        invariant = self._invariant(*move.subject)
        asked = data_atoms([invariant.condition])
        if asked:
            values = self._witness.values([Wish(Not(invariant.condition), self._states), *self._kept(move, names)])
            if values is None:
                self._lose(sorted({atom.data for atom in asked}))
            else:
                self._receive(values, quietly=False)
        if invariant.hold is not None and invariant.hold.for_s > 0:
            self._wait(invariant.hold.for_s)

    def _wait(self, time_s: float) -> None:
        situation = replace(self._situation, now_ns=self._situation.now_ns + nanoseconds(time_s))
        step = semantics.elapse(self._skillset, situation)
        self._situation = step.situation
        text = f"{time_s:g} s pass{words.violations(step, self._name)}"
        self._add(StepKind.TIME, text, step=step, time_s=time_s)

    def _born_broken(self, move: Move, names: Mapping[str, Running], invariant: Invariant) -> None:
        """Have data fulfil the preconditions, and not the invariant after the start."""
        skill = self._skill(move)
        after = {**self._states, **{change.resource: change.target for change in skill.start.assignments}}
        earlier = [Wish(self._good(skill.name, one), after) for one in skill.invariants[: skill.invariants.index(invariant)]]
        wishes = [*self._ready(move), *(wish for wish in earlier if data_atoms([wish.condition]))]
        wishes += self._kept(move, names, but=names["new"])
        values = self._witness.values([*wishes, Wish(Not(invariant.condition), after)])
        fell = fallen(invariant)
        if values is None and fell is not None:
            values = self._witness.values([*wishes, Wish(Not(invariant.recovered), after)])
            low = self._witness.values([Wish(fell, self._states), *self._kept(move, names, but=names["new"])])
            if low is not None:
                self._receive(low)
        if values is None:
            raise _NoValuesError
        self._receive(values)

    # --- what is wished of data -----------------------------------------------------------------------------------

    def _ready(self, move: Move) -> list[Wish]:
        """Return the preconditions over data of a skill that starts."""
        if move.kind is not StepKind.START:
            return []
        conditions = [precondition.condition for precondition in self._skill(move).preconditions]
        return [Wish(condition, self._states) for condition in conditions if data_atoms([condition])]

    def _kept(self, move: Move, names: Mapping[str, Running], *, but: Running | None = None, waiting: bool = False) -> list[Wish]:
        """Return the invariants over data of what runs on after the step, in the states before and after it.

        Those that may be false for a while (``for 2 s``) are left out unless ``waiting``.
        """
        after = self._system.situation(move.target).states
        left = [names[one.id] for one in move.step.situation.running] if move.step is not None else self._running
        wishes: list[Wish] = []
        for execution in (one for one in left if one != but):
            moments = [after] if execution not in self._running else [self._states, after]
            for invariant in self._skillset.skill(execution.skill).invariants:
                if data_atoms([invariant.condition]) and (waiting or not waits(invariant)):
                    wishes += [Wish(self._good(execution.skill, invariant), states) for states in moments]
        return wishes

    def _good(self, skill: str, invariant: Invariant) -> Expression:
        """Return when an invariant counts as true now: a value that has fallen must recover first."""
        fell = (skill, invariant.name) in self._situation.fallen
        return invariant.recovered if fell else invariant.condition

    def _broken_at_birth(self, fault: Key) -> Invariant | None:
        """Return the invariant over data that is false right after the start by a fault."""
        if not fault or fault[0] != "after start":
            return None
        invariant = self._invariant(fault[1], fault[2])
        return invariant if data_atoms([invariant.condition]) else None

    def _invariant(self, skill: str, name: str) -> Invariant:
        return next(one for one in self._skillset.skill(skill).invariants if one.name == name)

    def _skill(self, move: Move) -> Skill:
        return self._skillset.skill(move.subject[0])

    # --- without data, and words ----------------------------------------------------------------------------------

    def _take_as_searched(self, move: Move, names: Mapping[str, Running]) -> None:
        step = None if move.step is None else _renamed(move.step, names)
        if move.kind is StepKind.BREAK and step is not None:
            self._add(StepKind.BREAK, words.broken(move, step, self._name), subject=move.subject, step=step)
        else:
            self._tell(move, step, names)

    def _tell(self, move: Move, step: Step | None, names: Mapping[str, Running]) -> None:
        acting = names.get(move.stimulus.execution.id)
        called = "" if acting is None else self._name(acting)
        text = words.told(move, step, self._name, called)
        execution = None if acting is None else self._execution(acting)
        self._add(move.kind, text, subject=move.subject, step=step, execution=execution, refused=step is None)

    def _add(
        self,
        kind: StepKind,
        text: str,
        *,
        subject: tuple[str, ...] = (),
        step: Step | None = None,
        execution: NumberedExecution | None = None,
        refused: bool = False,
        data: tuple[tuple[Path, Value | None], ...] = (),
        time_s: float = 0.0,
    ) -> None:
        happenings = step.happenings if step is not None else ()
        changes = tuple(StateChange(one.resource, one.source, one.target) for one in words.changes_of(happenings))
        ended = tuple(
            CounterexampleEnd(self._execution(one.execution), one.state.value, one.result)
            for one in happenings
            if isinstance(one, Entered) and one.state is not ExecutionState.RUNNING
        )
        states = tuple((self._situation if step is None else step.situation).states.items())
        running = tuple(self._execution(one) for one in self._running)
        self.steps.append(
            CounterexampleStep(kind, text, subject, execution, changes, ended, refused, data, time_s, states=states, running=running)
        )

    def _execution(self, execution: Running) -> NumberedExecution:
        return NumberedExecution(execution.skill, int(execution.id.rpartition("-")[2]))

    def _name(self, execution: Running) -> str:
        """Call an execution by its skill, and by its number where several run."""
        several = sum(one.skill == execution.skill for one in {*self._running, execution}) > 1
        return f"{execution.skill} (execution {self._execution(execution).number})" if several else execution.skill


def _renamed(step: Step, names: Mapping[str, Running]) -> Step:
    """Return a step of the search with the executions of the counterexample."""
    happenings: list[Change | Entered] = []
    for one in step.happenings:
        if isinstance(one, Entered):
            happenings.append(replace(one, execution=names[one.execution.id]))
            continue
        skill, _, rest = one.cause.partition(" ")
        number, _, name = rest.partition(" ")
        known = names.get(number)
        ours = known is not None and known.skill == skill and bool(name)
        happenings.append(replace(one, cause=f"{skill} {known.id} {name}") if ours and known is not None else one)
    return Step(step.situation, tuple(happenings))
