"""The ways in which something can fail, from the models, and where a run's events show one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from alula.common.faults import FaultRequest
from alula.model.breaking import breaks
from alula.model.execution_state import ExecutionState as S
from alula.model.model import ResultKind, Skill, Skillset
from alula.records.causes.effects import EXTERN
from alula.records.causes.failures import SkillFailure, skill_failures
from alula.records.causes.faults import Fault, trace
from alula.records.causes.responses import NO_SKILL, response_to, response_to_fault
from alula.records.tree import Places
from alula.runtime.core.events import EngineEvent, TransitionEvent

FAULT, PROCESS, RESULT, INVARIANT, TRANSITION = "fault", "process", "result", "invariant", "extern transition"
KINDS = (FAULT, PROCESS, RESULT, INVARIANT, TRANSITION)
NO_NEED = "not in use"
"""A transition that broke no invariant: nothing that ran hung on it."""


@dataclass(frozen=True, order=True)
class Way:
    """One way to fail.

    ``name`` is ``skillset.skill RESULT``, ``skillset.skill invariant``, ``skillset.resource A -> B``, a process, or a fault of the
    command line without its times.
    """

    kind: str
    name: str


@dataclass(frozen=True)
class Failure:
    """A failure that happened in a run.

    Attributes:
        at_s: when, seconds of mission clock.
        answered_by: the branch of the tree that took over (see ``Places.response``); the skill's name where that is not known.
        skill: the skill that started next, ``skillset.skill``.
        after_s: how long after the failure it ran; None: none was started.
    """

    way: Way
    at_s: float
    answered_by: str = NO_SKILL
    skill: str = NO_SKILL
    after_s: float | None = None


def ways_to_fail(skillsets: Iterable[Skillset], processes: Iterable[str] = ()) -> list[Way]:
    """Return every result that is a failure, every invariant, every extern transition that breaks an invariant, every process."""
    found: list[Way] = []
    for skillset in skillsets:
        for skill in skillset.skills:
            found += [Way(RESULT, f"{skillset.name}.{skill.name} {name}") for name in _failures_of(skill)]
            found += [Way(INVARIANT, f"{skillset.name}.{skill.name} {one.name}") for one in skill.invariants]
        for resource in skillset.resources:
            breaking = [one for one in resource.transitions if one.extern and breaks(skillset, resource, one)]
            found += [Way(TRANSITION, _transition(skillset.name, resource.name, one.source, one.target)) for one in breaking]
    return [*dict.fromkeys(found), *(Way(PROCESS, name) for name in processes)]


def _failures_of(skill: Skill) -> list[str]:
    return [result.name for result in skill.results if skill.kind_of(result.name) is ResultKind.FAILURE]


def _transition(skillset: str, resource: str, source: str, target: str) -> str:
    return f"{skillset}.{resource} {source} -> {target}"


# --- in a run --------------------------------------------------------------------------------------------------------


def failures_in(events: Sequence[EngineEvent], known: Iterable[Way], places: Places) -> list[Failure]:
    """Return the failures of a run in the order of time, each with the branch of the tree and the skill that followed."""
    ways = set(known)
    violated = [failure for failure in skill_failures(events) if failure.end.state is S.RESOURCE_INVARIANT_VIOLATED]
    broken = {at: failure for failure in reversed(violated) for at in failure.behind}
    found = []
    for at, event in enumerate(events):
        way = _way_of(event)
        if way is not None and way in ways:
            failure = broken.get(at) if isinstance(event, TransitionEvent) else SkillFailure(at, event, event.stamp_s)
            found.append(_failure(way, event.stamp_s, failure, events, places))
    return found


def failures_by(causes: Sequence[tuple[Way, Fault]], events: Sequence[EngineEvent], places: Places) -> list[Failure]:
    """Return what failed by faults, or by processes that ended, as one failure each; see ``causes.faults.trace``."""
    found = []
    for (way, fault), traced in zip(causes, trace([fault for _, fault in causes], events), strict=True):
        response, after_s = response_to_fault(traced, events, places)
        found.append(Failure(way, fault.at_s, response.branch, response.skill, after_s))
    return found


def name_of(fault: FaultRequest) -> str:
    """Return a fault without its times; one that ends is another than one that stays."""
    return f"{replace(fault, begin_s=None, end_s=None)}{'' if fault.end_s is None else ', ends again'}"


def _way_of(event: EngineEvent) -> Way | None:
    if isinstance(event, TransitionEvent):
        name = _transition(event.skillset, event.resource, event.from_state, event.to_state)
        return Way(TRANSITION, name) if event.cause == EXTERN else None
    if event.state is S.TERMINATED:
        return Way(RESULT, f"{event.skillset}.{event.skill} {event.result}")
    if event.state is S.RESOURCE_INVARIANT_VIOLATED:
        return Way(INVARIANT, f"{event.skillset}.{event.skill} {event.result}")
    return None


def _failure(way: Way, at_s: float, failure: SkillFailure | None, events: Sequence[EngineEvent], places: Places) -> Failure:
    """Return a failure with the first skill that was asked for and ran after it."""
    if failure is None:
        return Failure(way, at_s, NO_NEED, NO_NEED)
    response = response_to(failure, events, places)
    return Failure(way, at_s, response.branch, response.skill, None if response.ran_s is None else response.ran_s - at_s)


def as_dict(failure: Failure, origin_s: float) -> Mapping[str, object]:
    """Return a failure for a table's row; its time counts from ``origin_s``."""
    after_s = None if failure.after_s is None else round(failure.after_s, 6)
    return {
        "kind": failure.way.kind,
        "name": failure.way.name,
        "at_s": round(failure.at_s - origin_s, 6),
        "answered_by": failure.answered_by,
        "skill": failure.skill,
        "after_s": after_s,
    }
