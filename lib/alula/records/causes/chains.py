"""Build a failure's chain of causes: the fault, its detection, the broken conditions, and the mission's reaction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from alula.model.execution_state import ExecutionState as S
from alula.records.causes.branches import Trees, failed_branch, next_branch
from alula.records.causes.effects import EXTERN, EffectsByFault
from alula.records.causes.failures import SkillFailure
from alula.records.causes.faults import EARLY_S
from alula.records.causes.wording import in_words, state_text, why_of
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from alula.runtime.core.records import ExecutionRecord, executions_of

REACTION_S = 3.0
"""For so long after a failure the mission's reaction is looked for; in a pause, after its end."""
REACTIONS = ("decision", "stopped", "started")
REPORTED = "reported by the functional layer"


@dataclass(frozen=True)
class Step:
    """One step of the chain; ``told``: its text within a sentence, where that differs."""

    step: str
    t_s: float
    text: str
    told: str = ""


@dataclass(frozen=True)
class KnownFault:
    """A fault and what followed from it, seconds of mission clock; ``failed``: the ids of executions that failed because of it."""

    name: str
    mode: str
    at_s: float
    until_s: float | None
    text: str
    injected: bool = True
    detected_s: float | None = None
    detected_by: str = ""
    answered_by: str = ""
    failed: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Judgement:
    """What a watch thought of a sensor from a moment on; ``fault`` and ``reason`` where it was not ``ok``."""

    t_s: float
    ok: bool
    fault: str
    reason: str


@dataclass(frozen=True)
class Scene:
    """What is known of a run besides its faults; ``pauses``: from when to when the mission was held, ``aborts``: when it was aborted."""

    events: Sequence[EngineEvent]
    trees: Trees = field(default_factory=Trees)
    judgements: Mapping[str, Sequence[Judgement]] = field(default_factory=dict)
    pauses: Sequence[tuple[float, float]] = ()
    aborts: Sequence[float] = ()
    effects: EffectsByFault = field(default_factory=EffectsByFault)


def chain_of(failure: SkillFailure, fault: KnownFault | None, scene: Scene, failures: Sequence[SkillFailure]) -> list[Step]:
    """Return the steps in the order of time; ``failures`` are all of the run."""
    end = failure.end
    # A cause is stamped some ticks of the clock late at most, and an effect early.
    causes = [replace(one, t_s=min(one.t_s, end.stamp_s)) for one in _causes(failure, fault, scene)]
    effects = [*_branch(end, fault, scene), *_reaction(failure, scene, failures)]
    own = Step("skill", end.stamp_s, f"{end.skillset}.{end.skill} ended: {state_text(end)}")
    return sorted([*causes, own, *(replace(one, t_s=max(one.t_s, end.stamp_s)) for one in effects)], key=lambda one: one.t_s)


def reaction_in(chain: Sequence[Step]) -> tuple[float, str] | None:
    """Return when the mission did something about a failure, and what, in words; None where nothing followed."""
    steps = [one for one in chain if one.step in REACTIONS]
    return (steps[0].t_s, "; ".join(one.told or one.text.replace(":", "") for one in steps)) if steps else None


def _causes(failure: SkillFailure, fault: KnownFault | None, scene: Scene) -> Iterator[Step]:
    end = failure.end
    change = scene.events[failure.behind[0]] if failure.behind else None
    if fault is not None:
        yield Step("failure", fault.at_s, fault.text)
    yield from _measurement(end, fault, change, scene)
    if isinstance(change, TransitionEvent):
        by = REPORTED if change.cause == EXTERN else change.cause
        because = f": {change.reason}" if change.reason else ""
        text = f"{change.skillset}.{change.resource}: {change.from_state} → {change.to_state}, {by}{because}"
        yield Step("resource", change.stamp_s, text)
    elif fault is not None and fault.detected_s is not None and " -> " in fault.detected_by:
        yield Step("resource", fault.detected_s, f"{fault.detected_by.replace(' ', ': ', 1).replace('->', '→')}, {REPORTED}")
    if end.state is S.RESOURCE_INVARIANT_VIOLATED:
        yield Step("invariant", end.stamp_s, f"{end.result} of {end.skill}: {why_of(end)}")


def _measurement(end: ExecutionEvent, fault: KnownFault | None, change: EngineEvent | None, scene: Scene) -> Iterator[Step]:
    """Yield the judgement of a sensor's health check, else the value that an unmet condition tests."""
    sensors = [] if fault is None else [fault.name]
    if isinstance(change, TransitionEvent):
        sensors += [name for name in scene.judgements if scene.effects.of(name).shows(change)]
    for sensor in sensors:
        last = [one for one in scene.judgements.get(sensor, ()) if one.t_s <= end.stamp_s + EARLY_S][-1:]
        if last and not last[0].ok:
            yield Step("measurement", last[0].t_s, f"{sensor} is {last[0].fault or 'not fine'}: {last[0].reason}")
            return
    values = ((name, value) for one in end.unmet for name, value in one.data.items() if value is not None)
    for name, value in values:
        shown = f"{value:.4g}" if isinstance(value, float) else str(value)
        yield Step("measurement", end.stamp_s, in_words(f"{name} is {shown}"))
        return


def reacts_until_s(t_s: float, scene: Scene) -> float:
    """Return until when a reaction is looked for: a mission that is paused then reacts later; what follows an abort is the abort's."""
    goes_on_s = next((until_s for from_s, until_s in scene.pauses if from_s <= t_s < until_s), t_s)
    abort_s = next((at_s for at_s in scene.aborts if at_s >= t_s), math.inf)
    return min(goes_on_s + REACTION_S, abort_s - 0.001)


def _branch(end: ExecutionEvent, fault: KnownFault | None, scene: Scene) -> Iterator[Step]:
    until_s = reacts_until_s(end.stamp_s, scene)
    failed = failed_branch(scene.trees, f"{end.skillset}.{end.skill}", end.stamp_s, until_s)
    if failed is None:
        return
    yield Step("branch", failed.failed_s(end.stamp_s, until_s) or end.stamp_s, f"“{failed.name}” failed")
    following = next_branch(failed, "" if fault is None else fault.answered_by)
    if following is not None and failed.parent is not None:
        ticked_s = following.ticked_s
        at_s = max(end.stamp_s, ticked_s) if ticked_s is not None and ticked_s <= until_s else end.stamp_s
        told = f"the mission fell back from “{failed.name}” to “{following.name}”"
        yield Step("decision", at_s, f"“{failed.parent.name}” went on with “{following.name}”", told)
    elif failed.parent is None:
        yield Step("decision", end.stamp_s, "nothing was left to try")


def _reaction(failure: SkillFailure, scene: Scene, failures: Sequence[SkillFailure]) -> Iterator[Step]:
    """Yield the skills that were interrupted for a failure's sake, and those that were started."""
    end, end_s = failure.end, failure.end.stamp_s
    until_s = reacts_until_s(end_s, scene)
    earlier_s = max((one.end.stamp_s for one in failures if one.end.stamp_s < end_s), default=-math.inf)
    # What came shortly before this failure belongs to one before it, if there was one.
    from_s = end_s if earlier_s >= end_s - REACTION_S else end_s - EARLY_S
    others = _others(scene.events, failure)
    interrupted = [one for one in others if one.state is S.INTERRUPTED and one.requested_s < end_s]
    stopped = [one for one in interrupted if one.ended_s is not None and from_s <= one.ended_s <= until_s]
    started = [one for one in others if one.started_s is not None and from_s <= one.started_s <= until_s]
    started = [one for one in started if one.requested_s >= end_s - EARLY_S]
    if stopped and stopped[0].ended_s is not None:
        yield Step("stopped", stopped[0].ended_s, f"interrupted: {', '.join(one.skill for one in stopped)}")
    if started and started[0].started_s is not None:
        own = (end.skillset, end.skill)
        names = dict.fromkeys(f"{one.skill} again" if (one.skillset, one.skill) == own else one.skill for one in started)
        yield Step("started", started[0].started_s, f"started: {', '.join(names)}")


def _others(events: Sequence[EngineEvent], failure: SkillFailure) -> list[ExecutionRecord]:
    """Return the executions of a run but for the one that failed."""
    ended = (failure.end.skillset, failure.end.skill, failure.end.id)
    return [one for one in executions_of(events) if (one.skillset, one.skill, one.id) != ended]
