"""Where skills failed in a run's events, and which changes of resources each failure follows from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alula.model.execution_state import ExecutionState as S
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent


@dataclass(frozen=True)
class SkillFailure:
    """An execution that ended badly.

    Attributes:
        at: its place in the run's events.
        end: the event of its end.
        asked_s: when it was asked for, seconds of mission clock.
        behind: the places of the changes that it follows from, the newest first: of the resources whose states were not as a condition
            needs them; of an invariant, the change that violated it. Empty where something else ended the execution, and where the record
            does not say what was unmet.
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
        if event.failed:
            places = {(resource, to_state): place for resource, (to_state, place) in own.items()}
            behind = sorted({places[found] for found in _states_found(event) if found in places}, reverse=True)
            newest = 1 if event.state is S.RESOURCE_INVARIANT_VIOLATED else None  # what it was violated by
            found.append(SkillFailure(at, event, asked_s[key], tuple(behind[:newest])))
    return found


def _states_found(event: ExecutionEvent) -> list[tuple[str, str]]:
    """Return the resources that unmet conditions ask, each with the state that it was in."""
    return [found for one in event.unmet for found in one.states.items()]
