"""The ways in which something can fail, from the models, and where a flight's events show one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from alula_common.faults import FaultRequest
from run_analysis.tree import Places
from skill_model.conditions import NO_DATA, judge
from skill_model.execution_state import ExecutionState as S
from skill_model.model import Invariant, Resource, ResourceIs, Result, ResultKind, Skillset, Transition, atoms
from skill_runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from skill_runtime.mock.behaviour import UNHAPPY_WORDS

FAULT, PROCESS, RESULT, INVARIANT, ARROW = "fault", "process", "result", "invariant", "extern arrow"
KINDS = (FAULT, PROCESS, RESULT, INVARIANT, ARROW)
NO_SKILL = "no skill"
"""The mission started none any more."""
NO_FAILURE = "nothing failed"
"""A fault, or the end of a process, after which no skill failed."""
NO_NEED = "not in use"
"""A transition that broke no invariant: nothing that ran hung on it."""
_EXTERN = "extern"


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
    """A way to fail that came about.

    Attributes:
        at_s: when, seconds of mission clock.
        answered_by: the branch of the tree that took over (see ``Places.answer``); the skill's name where that is not known.
        skill: the skill that started next, ``skillset.skill``.
        after_s: how long after the failure it ran; None: none was started.
    """

    way: Way
    at_s: float
    answered_by: str = NO_SKILL
    skill: str = NO_SKILL
    after_s: float | None = None


def ways_to_fail(skillsets: Iterable[Skillset], processes: Iterable[str] = ()) -> list[Way]:
    """Return every result that is no success, every invariant, every extern arrow that breaks an invariant, every process."""
    found: list[Way] = []
    for skillset in skillsets:
        for skill in skillset.skills:
            found += [Way(RESULT, f"{skillset.name}.{skill.name} {one.name}") for one in skill.results if is_failure(one)]
            found += [Way(INVARIANT, f"{skillset.name}.{skill.name} {one.name}") for one in skill.invariants]
        for resource in skillset.resources:
            arrows = [arrow for arrow in resource.transitions if arrow.extern and breaks(skillset, resource, arrow)]
            found += [Way(ARROW, _arrow(skillset.name, resource.name, arrow.source, arrow.target)) for arrow in arrows]
    return [*dict.fromkeys(found), *(Way(PROCESS, name) for name in processes)]


def is_failure(result: Result) -> bool:
    """Tell whether a result is none of success: a failure, or, where the notation does not say, a name that says so."""
    if result.kind is ResultKind.PLAIN:
        return any(word in result.name.upper() for word in UNHAPPY_WORDS)
    return result.kind is ResultKind.FAILURE


def breaks(skillset: Skillset, resource: Resource, arrow: Transition) -> bool:
    """Tell whether an arrow can make an invariant false that was not."""
    return any(_breaks(skillset, one, resource, arrow) for skill in skillset.skills for one in skill.invariants)


def _breaks(skillset: Skillset, invariant: Invariant, resource: Resource, arrow: Transition) -> bool:
    names = list(dict.fromkeys(atom.resource for atom in atoms(invariant.condition) if isinstance(atom, ResourceIs)))
    if resource.name not in names:
        return False
    others = [name for name in names if name != resource.name]
    for states in itertools.product(*(skillset.resource(name).states for name in others)):
        rest = dict(zip(others, states, strict=True))
        before, after = (judge(invariant.condition, {**rest, resource.name: state}, NO_DATA) for state in (arrow.source, arrow.target))
        if before is not False and after is False:
            return True
    return False


def _arrow(skillset: str, resource: str, source: str, target: str) -> str:
    return f"{skillset}.{resource} {source} -> {target}"


# --- in a flight --------------------------------------------------------------------------------------------------------


def failures_in(events: Sequence[EngineEvent], known: Iterable[Way], places: Places) -> list[Failure]:
    """Return the failures of a flight in the order of time, each with the branch of the tree and the skill that followed."""
    ways = set(known)
    told = [(at, way) for at, event in enumerate(events) for way in _ways_of(event) if way in ways]
    return [_answered(way, events, at, places) for at, way in told]


def name_of(fault: FaultRequest) -> str:
    """Return a fault without its times; one that ends is another than one that stays."""
    return f"{replace(fault, begin_s=None, end_s=None)}{'' if fault.end_s is None else ', ends again'}"


def failures_by(causes: Sequence[tuple[Way, float]], failures: Sequence[Failure]) -> list[Failure]:
    """Return what failed by faults, or by processes that ended, as one failure each.

    Each is answered as the first failure after it and before the next cause; its recovery counts from the cause.

    Args:
        causes: each with its time, seconds of mission clock, in the order of time.
        failures: of the flight, in the order of time.
    """
    found: list[Failure] = []
    for number, (way, at_s) in enumerate(causes):
        until_s = causes[number + 1][1] if number + 1 < len(causes) else math.inf
        first = next((one for one in failures if at_s <= one.at_s < until_s and one.answered_by != NO_NEED), None)
        if first is None:
            found.append(Failure(way, at_s, NO_FAILURE, NO_FAILURE))
        else:
            after_s = None if first.after_s is None else first.at_s - at_s + first.after_s
            found.append(Failure(way, at_s, first.answered_by, first.skill, after_s))
    return found


def _ways_of(event: EngineEvent) -> Iterator[Way]:
    if isinstance(event, TransitionEvent):
        if event.cause == _EXTERN:
            yield Way(ARROW, _arrow(event.skillset, event.resource, event.from_state, event.to_state))
    elif event.state is S.TERMINATED:
        yield Way(RESULT, f"{event.skillset}.{event.skill} {event.result}")
    elif event.state is S.RESOURCE_INVARIANT_VIOLATED:
        yield Way(INVARIANT, f"{event.skillset}.{event.skill} {event.result}")


def _answered(way: Way, events: Sequence[EngineEvent], at: int, places: Places) -> Failure:
    """Return a failure with the first skill that was asked for and ran after it."""
    begun_s, failed = events[at].stamp_s, _failed(events, at)
    if failed is None:
        return Failure(way, begun_s, NO_NEED, NO_NEED)
    started = _started(events[at + 1 :])
    branch = places.answer(failed, None if started is None else started.id)
    if started is None:
        return Failure(way, begun_s, branch or NO_SKILL)
    skill = f"{started.skillset}.{started.skill}"
    return Failure(way, begun_s, branch or skill, skill, started.stamp_s - begun_s)


def _started(events: Iterable[EngineEvent]) -> ExecutionEvent | None:
    """Return the start of the first execution that was asked for and ran."""
    requested: set[str] = set()
    for event in events:
        if isinstance(event, ExecutionEvent) and event.state is S.REQUESTED:
            requested.add(event.id)
        elif isinstance(event, ExecutionEvent) and event.state is S.RUNNING and event.id in requested:
            return event
    return None


def _failed(events: Sequence[EngineEvent], at: int) -> str | None:
    """Return the id of the execution that failed; of a transition, what it broke, which comes next in its skillset, None: nothing."""
    first = events[at]
    if isinstance(first, ExecutionEvent):
        return first.id
    for event in events[at + 1 :]:
        if event.skillset != first.skillset:
            continue
        if isinstance(event, ExecutionEvent):
            return event.id if event.state is S.RESOURCE_INVARIANT_VIOLATED else None
        if event.cause == _EXTERN:
            return None
    return None


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
