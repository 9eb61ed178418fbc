"""Plays a counterexample of the proofs in running managers: the same requests, reports and data, one after another, in virtual time.

Functions are hooks that do nothing but what the story says: they end with its results, and make progress meanwhile. After each
step, the states of the resources and the ends of the executions are held against the story.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from types import SimpleNamespace

from skill_language.prove.outside import opened
from skill_language.prove.witness import messages
from skill_language.stories import Execution, Story, StoryStep
from skill_language.stories import StepKind as Kind
from skill_model.model import Skillset
from skill_runtime.core.execution import Execution as Running
from skill_runtime.handle import SkillHandle
from skill_runtime.hooks import SkillHooks
from skill_runtime.local import LocalManagers, LocalWorld
from skill_runtime.local.values import complete

READY_S = 1.0


@dataclass(frozen=True)
class PlayedStep:
    """A step of the story, and how the managers differ from it: a line for each difference, none where they agree."""

    step: StoryStep
    differences: tuple[str, ...] = ()


class _Function(SkillHooks):
    """A function that goes on until the story ends it."""

    def __init__(self) -> None:
        self.running: dict[str, Running] = {}
        self._reports = 0

    def on_dispatch(self, execution: Running) -> None:
        """Note what runs."""
        self.running[execution.id] = execution

    def progress(self, execution: Running) -> float:  # noqa: ARG002 - the hook's signature
        """Return another number each time, so that no deadline of progress passes."""
        self._reports += 1
        return (self._reports % 100) / 100


def play(skillset: Skillset, story: Story) -> list[PlayedStep]:
    """Play a story from its first step on; stop after the first step that comes out otherwise."""
    player = _Player(skillset, story)
    played: list[PlayedStep] = []
    for step in story.steps:
        played.append(PlayedStep(step, tuple(player.take(step))))
        if played[-1].differences:
            break
    return played


@dataclass
class _Known:
    """An execution of the story: its handle and how it ended there."""

    handle: SkillHandle
    function: _Function
    ends: list[tuple[str, str]] = field(default_factory=list)


class _Player:
    def __init__(self, skillset: Skillset, story: Story) -> None:
        arrows = _from_outside(story)
        # Managers refuse what is not extern; arrows that the story has taken from outside are, in this play.
        self._skillset = opened(skillset, arrows) if arrows else skillset
        self._functions = {skill.name: _Function() for skill in skillset.skills}
        self._world = LocalWorld([self._skillset], lambda _managers: self._functions)
        self._managers: LocalManagers = self._world.managers[skillset.name]
        self._client = self._world.client(skillset.name)
        self._client.wait_ready(READY_S)
        self._executions: dict[Execution, _Known] = {}
        self._data: dict[str, object] = {}
        periods = [data.period_s for data in skillset.data if data.period_s is not None]
        self._refresh_s = min(periods, default=1.0) / 2

    def take(self, step: StoryStep) -> Iterable[str]:
        """Do what a step says, let the managers come to rest, and yield each difference from the story."""
        refusal = self._do(step)
        self._world.run_for(0.0)
        if refusal:
            yield refusal
        for execution, ended in ((one.execution, one) for one in step.ended):
            known = self._executions.get(execution)
            if known is not None:
                known.ends.append((ended.state, ended.name))
        states = {name: status.state for name, status in self._managers.engine.resources.items()}
        for name, state in step.states:
            if states[name] != state:
                yield f"{name} is {states[name]} in the managers, {state} in the story"
        told, found = Counter(one.skill for one in step.running), Counter(one.skill for one in self._managers.engine.executions)
        for skill in sorted({*told, *found}):
            if told[skill] != found[skill]:
                yield f"{found[skill]} executions of {skill} run in the managers, {told[skill]} in the story"
        yield from self._ends()

    def _ends(self) -> Iterable[str]:
        """Yield each execution that has not ended as in the story, or not yet."""
        for execution, known in self._executions.items():
            handle = known.handle
            found = [(str(handle.outcome), handle.result)] if handle.done else []
            if found != known.ends:
                managers, story = (" ".join(ends[0]).strip() if ends else "running" for ends in (found, known.ends))
                yield f"{execution.skill} (execution {execution.number}) is {managers} in the managers, {story} in the story"

    def _do(self, step: StoryStep) -> str:
        """Do what a step says; return why the managers refuse it, or nothing."""
        match step.kind:
            case Kind.EXTERN | Kind.OUTSIDE:
                resource, state = step.subject
                return self._managers.transition(resource, state).reason
            case Kind.EVENT:
                reason = self._managers.engine.trigger(step.subject[0]).reason
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

    def _start(self, step: StoryStep) -> str:
        assert step.execution is not None  # noqa: S101 - a start has one
        # A story knows nothing of inputs: each is what an empty message has.
        inputs = complete(self._skillset.skill(step.execution.skill).inputs, {}, {})
        handle = self._client.start(step.execution.skill, **inputs)
        if step.refused:
            self._world.run_for(0.0)
            return "" if handle.done else f"{step.execution.skill} starts"
        self._executions[step.execution] = _Known(handle, self._functions[step.execution.skill])
        return ""

    def _end(self, step: StoryStep) -> str:
        known = self._executions.get(step.execution) if step.execution is not None else None
        if known is None or known.handle.done:
            return "it does not run in the managers"
        if step.kind is Kind.INTERRUPT:
            known.handle.interrupt()
        else:
            known.function.running[known.handle.id].terminate(step.subject[1])
        return ""

    def _receive(self, step: StoryStep) -> None:
        for name in dict.fromkeys(path[0] for path, value in step.data if value is None):
            self._data.pop(name, None)
            self._managers.engine.update_data(name, None)
        given = {path: value for path, value in step.data if value is not None}
        for name, message in messages(given).items():
            before = self._data.get(name)
            if isinstance(before, SimpleNamespace) and isinstance(message, SimpleNamespace):
                message = SimpleNamespace(**{**vars(before), **vars(message)})  # noqa: PLW2901 - fields that the step leaves as they are
            self._data[name] = message
            self._managers.publish(name, message)

    def _wait(self, time_s: float) -> None:
        """Let mission time pass; data that the story has not lost stay fresh."""
        end_s = self._world.now_s + time_s
        while self._world.now_s < end_s:
            self._world.run_for(min(self._refresh_s, end_s - self._world.now_s))
            for name, message in self._data.items():
                self._managers.publish(name, message)


def _from_outside(story: Story) -> frozenset[tuple[str, str, str]]:
    """Return the arrows that nothing in the model takes and the story has taken."""
    changes = [(step.changes[0], step.subject) for step in story.steps if step.kind is Kind.OUTSIDE]
    return frozenset((change.resource, change.source, change.target) for change, _ in changes)
