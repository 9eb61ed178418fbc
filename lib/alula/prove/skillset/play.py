"""Plays a counterexample of the proofs in running managers: the same requests, reports and data, one after another.

Functions are hooks that do only what the counterexample says: they end with its results, and make progress meanwhile. After each step,
 the states of the resources and the ends of the executions are held against the counterexample. The managers and their client are
those of any world: in virtual time, over rclpy, over rospy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace

from alula.language.counterexamples import Counterexample, CounterexampleStep, NumberedExecution, messages
from alula.language.counterexamples import StepKind as Kind
from alula.language.outside import opened
from alula.model.model import Skillset
from alula.prove.playing import PlayedFunction, differences, without_parameters
from alula.prove.skillset.play_world import MakeWorld, PlayWorld, virtual_world
from alula.runtime.core.execution import Execution as Running
from alula.runtime.core.replies import TransitionReply
from alula.runtime.handle import SkillHandle
from alula.runtime.waiting import Pending

READY_S = 60.0
"""How long (wall clock) managers and their client may take to find one another."""
TICK_S = 0.5
"""Mission time passes in steps of so much where nothing in the model is more frequent."""


@dataclass(frozen=True)
class PlayedStep:
    """A step of the counterexample, and its differences from the managers, one line each; none where they agree."""

    step: CounterexampleStep
    differences: tuple[str, ...] = ()


class _Function(PlayedFunction):
    """A function that records when its progress was requested last."""

    def __init__(self) -> None:
        super().__init__({})
        self.now_ns: Callable[[], int] = lambda: 0
        self.asked_ns: dict[str, int] = {}
        """When each execution was dispatched, or asked for its progress last; mission clock."""
        self._reports = 0

    def on_dispatch(self, execution: Running) -> None:
        self.asked_ns[execution.id] = self.now_ns()
        super().on_dispatch(execution)

    def progress(self, execution: Running) -> float:
        """Return another value each time, so that no deadline of progress passes."""
        self.asked_ns[execution.id] = self.now_ns()
        self._reports += 1
        return (self._reports % 100) / 100


def play(skillset: Skillset, counterexample: Counterexample, make_world: MakeWorld = virtual_world) -> list[PlayedStep]:
    """Play a counterexample from its first step on; stop after the first step with a difference."""
    transitions = _from_outside(counterexample)
    # Managers refuse what is not extern; transitions that the counterexample has taken from outside are, in this play.
    played_model = without_parameters(opened(skillset, transitions) if transitions else skillset)
    functions = {skill.name: _Function() for skill in skillset.skills}
    played: list[PlayedStep] = []
    with make_world(played_model, functions) as world:
        player = _Player(played_model, functions, world)
        for step in counterexample.steps:
            played.append(PlayedStep(step, tuple(player.take(step))))
            if played[-1].differences:
                break
    return played


@dataclass
class _Known:
    """An execution of the counterexample: its handle and how it ended there."""

    handle: SkillHandle
    function: _Function
    ends: list[tuple[str, str]] = field(default_factory=list)


class _Player:
    def __init__(self, skillset: Skillset, functions: Mapping[str, _Function], world: PlayWorld) -> None:
        self._functions = functions
        self._world = world
        self._managers = world.managers
        self._client = world.client
        self._client.wait_ready(READY_S)
        for function in functions.values():
            function.now_ns = lambda: world.now_ns
        self._executions: dict[NumberedExecution, _Known] = {}
        self._data: dict[str, object] = {}
        self._periods_s = {skill.name: skill.progress.period_s for skill in skillset.skills if skill.progress is not None}
        periods_s = [*self._periods_s.values(), *(data.period_s for data in skillset.data if data.period_s is not None)]
        self._tick_s = min(periods_s, default=2 * TICK_S) / 2

    def take(self, step: CounterexampleStep) -> Iterable[str]:
        """Take a step, let the managers come to rest, and yield each difference from the counterexample."""
        refusal = self._do(step)
        if refusal:
            yield refusal
        for execution, ended in ((one.execution, one) for one in step.ended):
            known = self._executions.get(execution)
            if known is not None:
                known.ends.append((ended.state, ended.name))
        self._world.settle(lambda: not any(self._differences(step)))
        yield from self._differences(step)

    def _differences(self, step: CounterexampleStep) -> Iterable[str]:
        """Yield each difference between the managers and the counterexample after a step."""
        yield from differences(self._managers.engine.resources, step.states)
        told, found = Counter(one.skill for one in step.running), Counter(one.skill for one in self._managers.engine.executions)
        for skill in sorted({*told, *found}):
            if told[skill] != found[skill]:
                yield f"{found[skill]} executions of {skill} run in the managers, {told[skill]} in the counterexample"
        yield from self._ends()

    def _ends(self) -> Iterable[str]:
        """Yield each execution that has not ended as in the counterexample, or not yet."""
        for execution, known in self._executions.items():
            handle = known.handle
            found = [(str(handle.outcome), handle.result)] if handle.done else []
            if found != known.ends:
                managers, expected = (" ".join(ends[0]).strip() if ends else "running" for ends in (found, known.ends))
                yield f"{execution.skill} (execution {execution.number}) is {managers} in the managers, {expected} in the counterexample"

    def _do(self, step: CounterexampleStep) -> str:
        """Take a step; return why the managers refuse it, or an empty text."""
        match step.kind:
            case Kind.EXTERN | Kind.OUTSIDE:
                return self._refusal(self._client.transition(*step.subject))
            case Kind.EVENT:
                reason = self._refusal(self._client.trigger(step.subject[0]))
                return "" if step.refused else reason
            case Kind.START:
                return self._start(step)
            case Kind.RESULT | Kind.INTERRUPT:
                return self._end(step)
            case Kind.DATA:
                self._receive(step)
            case Kind.TIME:
                self._wait(step.time_s)
            case Kind.BREAK:
                return "no values of data are known that break the invariant"
        return ""

    def _refusal(self, answer: Pending[TransitionReply]) -> str:
        self._world.settle(lambda: answer.done)
        if not answer.done:
            return "the managers do not answer"
        return answer.failure or answer.value.reason

    def _start(self, step: CounterexampleStep) -> str:
        assert step.execution is not None  # noqa: S101 - a start has one
        handle = self._client.start(step.execution.skill)
        if step.refused:
            self._world.settle(lambda: handle.done)
            return "" if handle.done else f"{step.execution.skill} starts"
        function = self._functions[step.execution.skill]
        self._executions[step.execution] = _Known(handle, function)
        self._world.settle(lambda: handle.done or handle.id in function.running)
        return ""

    def _end(self, step: CounterexampleStep) -> str:
        known = self._executions.get(step.execution) if step.execution is not None else None
        running = None if known is None or known.handle.done else known.function.running.get(known.handle.id)
        if known is None or running is None:
            return "it does not run in the managers"
        if step.kind is Kind.INTERRUPT:
            known.handle.interrupt()
        else:
            running.terminate(step.subject[1])
        return ""

    def _receive(self, step: CounterexampleStep) -> None:
        for name in dict.fromkeys(path[0] for path, value in step.data if value is None):
            self._data.pop(name, None)
            self._managers.update_data(name, None)
        given = {path: value for path, value in step.data if value is not None}
        for name, message in messages(given).items():
            before = self._data.get(name)
            if isinstance(before, SimpleNamespace) and isinstance(message, SimpleNamespace):
                message = SimpleNamespace(**{**vars(before), **vars(message)})  # noqa: PLW2901 - fields that the step leaves as they are
            self._data[name] = message
            self._managers.update_data(name, message)

    def _wait(self, time_s: float) -> None:
        """Let mission time pass in ticks; the managers do all that is due at one before the next."""
        left_ns = round(time_s * 1e9)
        while left_ns > 0:
            tick_ns = min(round(self._tick_s * 1e9), left_ns)
            left_ns -= tick_ns
            self._world.pass_time(tick_ns / 1e9)
            self._world.settle(self._has_caught_up)

    def _has_caught_up(self) -> bool:
        """Return whether nothing is due in the managers, and each execution was asked for its progress within the period."""
        due_ns, now_ns = self._managers.engine.due_ns, self._world.now_ns
        return (due_ns is None or due_ns > now_ns) and all(
            now_ns - self._functions[one.skill].asked_ns.get(one.id, now_ns) < self._periods_s[one.skill] * 1e9
            for one in self._managers.engine.executions
            if one.skill in self._periods_s
        )


def _from_outside(counterexample: Counterexample) -> frozenset[tuple[str, str, str]]:
    """Return the transitions that nothing in the model takes and the counterexample has taken."""
    changes = [(step.changes[0], step.subject) for step in counterexample.steps if step.kind is Kind.OUTSIDE]
    return frozenset((change.resource, change.source, change.target) for change, _ in changes)
