"""What the mission did about a failure: the branch of its tree that took over, and the skill that it started next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from alula.model.execution_state import ExecutionState as S
from alula.records.causes.failures import SkillFailure
from alula.records.causes.faults import Traced
from alula.records.tree import Places
from alula.runtime.core.events import EngineEvent, ExecutionEvent

NO_SKILL = "no skill"
"""The mission started none any more."""
NO_FAILURE = "nothing failed"
"""No skill failed because of it."""
NOT_DETECTED = "not detected"
"""No resource shows the fault, and no skill failed because of it."""


@dataclass(frozen=True)
class Response:
    """What followed a failure.

    Attributes:
        branch: of the tree, that took over (see ``Places.response``); the skill's name where that is not known.
        skill: the skill that started next, ``skillset.skill``.
        ran_s: when it ran, seconds of mission clock; None: none was started.
    """

    branch: str = NO_SKILL
    skill: str = NO_SKILL
    ran_s: float | None = None


def response_to(failure: SkillFailure, events: Sequence[EngineEvent], places: Places) -> Response:
    """Return what followed a skill's failure."""
    started = _started(events[failure.at + 1 :])
    branch = places.response(failure.end.id, None if started is None else started.id)
    if started is None:
        return Response(branch or NO_SKILL)
    skill = f"{started.skillset}.{started.skill}"
    return Response(branch or skill, skill, started.stamp_s)


def response_to_fault(traced: Traced, events: Sequence[EngineEvent], places: Places) -> tuple[Response, float | None]:
    """Return what followed a fault, and how long its recovery took, in seconds.

    It is the response to the first failure that follows from it. Its recovery counts from the fault; where the skill that failed was asked
    for later, from then on.
    """
    if not traced.failures:
        word = NOT_DETECTED if traced.detected_s is None else NO_FAILURE
        return Response(word, word), None
    first = traced.failures[0]
    response = response_to(first, events, places)
    since_s = max(traced.fault.at_s, first.asked_s)
    return response, None if response.ran_s is None else response.ran_s - since_s


def _started(events: Iterable[EngineEvent]) -> ExecutionEvent | None:
    """Return the start of the first execution that was asked for and ran."""
    requested: set[str] = set()
    for event in events:
        if isinstance(event, ExecutionEvent) and event.state is S.REQUESTED:
            requested.add(event.id)
        elif isinstance(event, ExecutionEvent) and event.state is S.RUNNING and event.id in requested:
            return event
    return None
