"""Proves that a log is legal: finds what to ask of a real engine, asks it, and compares what the engine tells."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from alula.model.execution_state import ExecutionState as S
from alula.model.model import Skillset
from alula.model.steps import Cause, Stimulus
from alula.records.conformance import SkillsetMonitor
from alula.runtime.core import SkillsetEngine
from alula.runtime.core.events import EngineEvent, TransitionEvent
from alula.runtime.core.execution import Execution
from alula.runtime.hooks import SkillHooks


class _Hooks(SkillHooks):
    """A function that does nothing by itself."""

    refusal = ""

    def validate(self, inputs: object) -> str:  # noqa: ARG002 - the hook's signature
        return self.refusal

    def on_interrupt(self, execution: Execution) -> bool | None:  # noqa: ARG002
        """Take until ``interrupted`` is called."""
        return False

    def on_pause(self, execution: Execution) -> str | None:  # noqa: ARG002
        return ""

    def on_resume(self, execution: Execution) -> str | None:  # noqa: ARG002
        return ""


def stimuli_of(skillset: Skillset, log: Sequence[EngineEvent]) -> list[Stimulus] | None:
    """Return what has asked for the steps of a log, one by one; None for a log that the monitor does not believe."""
    monitor, found, under_way = SkillsetMonitor(skillset), [], False
    for event in log:
        if monitor.take(event) is not None:
            return None
        belief = monitor.belief
        if not under_way and belief.stimulus is not None:
            found.append(belief.stimulus)
        elif belief.stimulus is not None:
            found[-1] = belief.stimulus
        under_way = bool(belief.expected)
    return found


def legal(skillset: Skillset, log: Sequence[EngineEvent]) -> bool:
    """Return whether an engine can be brought to tell this log; False may also mean that the search has not found how."""
    stimuli = stimuli_of(skillset, log)
    return stimuli is not None and [_key(event) for event in _played(skillset, stimuli)][: len(log)] == [_key(event) for event in log]


def _key(event: EngineEvent) -> tuple[object, ...]:
    if isinstance(event, TransitionEvent):
        return event.sequence, event.resource, event.from_state, event.to_state, event.cause
    return event.sequence, event.skill, event.id, event.state, event.result


def _played(skillset: Skillset, stimuli: Sequence[Stimulus]) -> list[EngineEvent]:
    """Return what an engine tells when it is asked all this."""
    told: list[EngineEvent] = []
    hooks = {skill.name: _Hooks() for skill in skillset.skills}
    engine = SkillsetEngine(skillset, lambda: 0, hooks, told.extend)
    for stimulus in stimuli:
        _ask(engine, hooks, stimulus)
    return told


def _ask(engine: SkillsetEngine, hooks: dict[str, _Hooks], stimulus: Stimulus) -> None:
    name, asked = stimulus.name, stimulus.execution
    match stimulus.cause:
        case Cause.EXTERN:
            engine.transition(name, stimulus.target)
        case Cause.EVENT:
            engine.trigger(name)
        case Cause.REQUEST:
            engine.register(asked.skill, {}, execution_id=asked.id)
        case Cause.START | Cause.REFUSE:
            engine.run(asked.id)
        case Cause.REJECT:
            hooks[asked.skill].refusal = "asked to"
            engine.run(asked.id)
            hooks[asked.skill].refusal = ""
        case Cause.PHASE:
            _PHASES[S(name)](engine, asked.id)
        case Cause.RESULT:
            engine.terminate(asked.id, name)
        case Cause.INTERRUPT:
            running = engine.execution(asked.id)
            (engine.interrupted if running is not None and running.state is S.INTERRUPTING else engine.interrupt)(asked.id)
        case Cause.FAIL:
            engine.fail(asked.id, "asked to")


_PHASES: dict[S, Callable[[SkillsetEngine, str], object]] = {
    S.PAUSED: SkillsetEngine.pause,
    S.RUNNING: SkillsetEngine.resume,
    S.INTERRUPTING: SkillsetEngine.interrupt,
}
