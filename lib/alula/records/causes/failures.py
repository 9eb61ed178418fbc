"""Where skills failed in a run's events, and which changes of resources each failure follows from."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from alula.model.execution_state import ExecutionState as S
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from alula.runtime.mock.behaviour import UNHAPPY_WORDS

_UNMET = frozenset({S.RESOURCE_INVARIANT_VIOLATED, S.NOT_READY})
_BAD_ENDS = _UNMET | {S.NOT_VALIDATED, S.FAILED}


@dataclass(frozen=True)
class SkillFailure:
    """An execution that ended badly.

    Attributes:
        at: its place in the run's events.
        end: the event of its end.
        asked_s: when it was asked for, seconds of mission clock.
        behind: the places of the changes that it follows from, the newest first: a condition on resources was not met, and its message
            names their states; of an invariant, the change that violated it. Empty where something else ended the execution.
    """

    at: int
    end: ExecutionEvent
    asked_s: float
    behind: tuple[int, ...] = ()


def skill_failures(events: Sequence[EngineEvent]) -> list[SkillFailure]:
    """Return the failures of a run in the order of its events."""
    found: list[SkillFailure] = []
    changed: dict[str, dict[str, tuple[str, int]]] = {}
    asked_s: dict[tuple[str, str], float] = {}
    for at, event in enumerate(events):
        own = changed.setdefault(event.skillset, {})
        if isinstance(event, TransitionEvent):
            own[event.resource] = (event.to_state, at)
            continue
        key = (event.skillset, event.id)
        asked_s.setdefault(key, event.stamp_s)
        if ended_badly(event):
            places = {(resource, to_state): place for resource, (to_state, place) in own.items()}
            behind = sorted({places[named] for named in _states_named(event) if named in places}, reverse=True)
            newest = 1 if event.state is S.RESOURCE_INVARIANT_VIOLATED else None  # what it was violated by
            found.append(SkillFailure(at, event, asked_s[key], tuple(behind[:newest])))
    return found


def _states_named(event: ExecutionEvent) -> list[tuple[str, str]]:
    """Return the resources and states that did not meet a condition, as the managers' messages name them: ``zed_status is BROKEN``."""
    return re.findall(r"(\w+) is (\w+)", event.message) if event.state in _UNMET else []


def ended_badly(event: ExecutionEvent) -> bool:
    """Tell whether an event is the end of an execution that failed; of results, a name that says so counts."""
    if event.state is S.TERMINATED:
        return any(word in event.result.upper() for word in UNHAPPY_WORDS)
    return event.state in _BAD_ENDS
