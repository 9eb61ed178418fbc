"""The hooks of a mocked skill: chooses by the rules what a call does, and does it by the clock."""

from __future__ import annotations

import bisect
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import SimpleNamespace
from typing import TYPE_CHECKING

from alula.mock.behaviour import Rule, Script, cascade, default_script
from alula.mock.formula import FormulaError, coordinates
from alula.mock.state import MockState
from alula.model.model import Skill
from alula.runtime.hooks import SkillHooks

if TYPE_CHECKING:
    from alula.runtime.core.execution import Execution
    from alula.runtime.timers import Timer


class MockCrashError(Exception):
    """Raised by a mocked function that is scripted to crash."""


class MockInputs(SimpleNamespace):
    """The inputs of a call by name; beside them, not among them, what was chosen for the call."""

    __slots__ = ("choice",)
    choice: Choice


@dataclass(frozen=True)
class Choice:
    """The script chosen for one call; ``result`` is empty where it does not end with a result by itself."""

    script: Script
    result: str


@dataclass(eq=False)
class PlayedScript:
    """A script that is being played for an execution: seconds of mission clock, and where it moves parts of the memory from and to."""

    execution: Execution
    choice: Choice
    names: Mapping[str, object]
    started_s: float
    delay_s: float
    moves: dict[str, tuple[object, object]]
    timers: list[Timer] = field(default_factory=list)


class MockSkill(SkillHooks):
    """One skill of a mock robot; its hooks may be called in any thread."""

    def __init__(self, state: MockState, skillset: str, skill: Skill, rules: Sequence[Rule], chance: random.Random) -> None:
        self._state = state
        self.place = skillset, skill.name
        self._inputs = [parameter.name for parameter in skill.inputs]
        self._rules = tuple(rules)
        self._default = default_script(skill)
        self._chance = chance
        self._calls = 0
        self._runs: dict[str, PlayedScript] = {}
        self._unattached = Choice(self._default, "")

    # --- hooks -------------------------------------------------------------------------------------------------------

    def make_inputs(self, values: Mapping[str, object]) -> object:
        """Make inputs that a choice can be attached to."""
        return MockInputs(**values)

    def validate(self, inputs: object) -> str:
        """Count the call, choose, and refuse if that was chosen."""
        choice = self.choose(inputs)
        if isinstance(inputs, MockInputs):
            inputs.choice = choice
        else:
            self._unattached = choice
        return choice.script.ending.refuse

    def on_dispatch(self, execution: Execution) -> None:
        """Begin the script that ``validate`` chose: its changes of resources, and its end. Raises MockCrashError where it is to crash."""
        choice = execution.inputs.choice if isinstance(execution.inputs, MockInputs) else self._unattached
        run = self._begin(execution, choice)
        after = self._state.host.after
        for change in choice.script.changes:
            when_s = max(0.0, self._state.number(change.after_s, run.names, self._chance))
            run.timers.append(after(when_s, lambda states=change.states: self._state.take(states)))  # type: ignore[misc]
        if choice.script.ending.crash and not run.delay_s:
            raise MockCrashError(choice.script.ending.crash)
        if choice.script.ending.crash or choice.result:
            run.timers.append(after(run.delay_s, lambda: self._finish(run)))

    def progress(self, execution: Execution) -> float:
        """Return the progress of the script."""
        run = self._runs.get(execution.id)
        if run is None:
            return execution.progress
        elapsed_s = self._state.host.now_s - run.started_s
        part = _part(elapsed_s, run.delay_s)
        said = run.choice.script.progress
        if isinstance(said, tuple):
            return _between(said, part)
        if isinstance(said, bool | int | float):
            return said
        return self._state.number(said, {**run.names, "t": elapsed_s, "f": part}, self._chance)

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop the script: moved memory stays where it is, further changes are dropped."""
        with self._state.lock:
            self.move()
            run = self._runs.pop(execution.id, None)
        for appointment in run.timers if run is not None else ():
            appointment.cancel()
        return None

    def end(self, result: str, message: str) -> None:
        """End what runs before its time: what it moves stays where it is."""
        with self._state.lock:
            executions = [run.execution for run in self._runs.values()]
        for execution in executions:
            self.on_interrupt(execution)
            execution.terminate(result, message)

    def move(self) -> None:
        """Bring the memory up to date; called with the robot's lock held."""
        for run in self._runs.values():
            self._move(run, _part(self._state.host.now_s - run.started_s, run.delay_s))

    def forget(self, execution_id: str) -> None:
        """Note the end of an execution by others: its moves are completed, further changes are dropped."""
        with self._state.lock:
            run = self._runs.pop(execution_id, None)
            if run is not None:
                self._move(run, 1.0)
        for appointment in run.timers if run is not None else ():
            appointment.cancel()

    # --- parts -------------------------------------------------------------------------------------------------------

    def choose(self, inputs: object) -> Choice:
        """Choose the script of the next call by the rules; subclasses may choose otherwise.

        There is one draw for each rule that has a chance, whether or not it applies.
        """
        with self._state.lock:
            self._calls += 1
            names = self._names(inputs)
            drawn = [rule.chance is None or self._chance.random() < rule.chance for rule in self._rules]
            rules = [rule for rule, lucky in zip(self._rules, drawn, strict=True) if lucky and self._applies(rule, names)]
            script = cascade(rules, self._default)
            results = dict(script.ending.results)
            result = self._chance.choices(list(results), list(results.values()))[0] if results else ""
            return Choice(script, result)

    def _applies(self, rule: Rule, names: Mapping[str, object]) -> bool:
        if rule.call is not None and rule.call != self._calls:
            return False
        return rule.when is None or bool(self._state.value(rule.when, names, self._chance))

    def _begin(self, execution: Execution, choice: Choice) -> PlayedScript:
        state, names = self._state, self._names(execution.inputs)
        delay_s = max(0.0, state.number(choice.script.delay, names, self._chance))
        with state.lock:
            targets = {name: state.value(value, names, self._chance) for name, value in choice.script.moves.items()}
            moves = {name: (state.memory.get(name), _plain(target)) for name, target in targets.items()}
            run = self._runs[execution.id] = PlayedScript(execution, choice, {**names, "delay": delay_s}, state.host.now_s, delay_s, moves)
        return run

    def _finish(self, run: PlayedScript) -> None:
        """End an execution with the result that its script has chosen."""
        with self._state.lock:
            if self._runs.pop(run.execution.id, None) is None:
                return
            self._move(run, 1.0)
        if run.choice.script.ending.crash:
            run.execution.fail(f"the mock crashed: {run.choice.script.ending.crash}")
            return
        said = run.choice.script.outputs
        try:
            outputs = {name: self._state.value(value, run.names, self._chance) for name, value in said.items()}
        except FormulaError as error:
            run.execution.fail(str(error))
            return
        run.execution.terminate(run.choice.result, run.choice.script.ending.message, outputs)

    def _move(self, run: PlayedScript, part: float) -> None:
        for name, (source, target) in run.moves.items():
            self._state.memory[name] = _towards(source, target, part)

    def _names(self, inputs: object) -> dict[str, object]:
        if isinstance(inputs, Mapping):
            return dict(inputs)
        return {name: getattr(inputs, name) for name in self._inputs if hasattr(inputs, name)}

    def __repr__(self) -> str:
        return f"MockSkill({'.'.join(self.place)})"


def _part(elapsed_s: float, delay_s: float) -> float:
    return min(1.0, elapsed_s / delay_s) if delay_s > 0.0 else 1.0


def _between(points: Sequence[tuple[float, float]], part: float) -> float:
    """Return the height of a line through points at ``part``; level outside."""
    if part >= points[-1][0]:
        return points[-1][1]
    if part < points[0][0]:
        return points[0][1]
    index = bisect.bisect_right([x for x, _ in points], part) - 1
    (x0, y0), (x1, y1) = list(pairwise(points))[index]
    return y0 + (y1 - y0) * (part - x0) / (x1 - x0)


def _plain(value: object) -> object:
    """Return numbers, and points as lists of numbers; anything else as it is."""
    if isinstance(value, bool | int | float | str):
        return value
    numbers = coordinates(value)
    return list(numbers) if numbers else value


def _towards(source: object, target: object, part: float) -> object:
    """Interpolate between two numbers or points; any other value changes at the end."""
    if part >= 1.0:
        return target
    if isinstance(source, int | float) and isinstance(target, int | float):
        return source + (target - source) * part
    if isinstance(source, list) and isinstance(target, list) and len(source) == len(target):
        return [_towards(one, other, part) for one, other in zip(source, target, strict=True)]
    return source
