"""What an operator is made to do in a run.

``--fail operator:pause@10-20`` pauses the mission and has it go on, ``operator:abort@15`` ends it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alula.common.faults import FaultRequest, parse_fault

OPERATOR, PAUSE, RESUME, ABORT = "operator", "pause", "resume", "abort"
FAULTS = {OPERATOR: (PAUSE, ABORT)}
"""Of every robot's runs: the operator, with what can be asked for."""


@dataclass(frozen=True, order=True)
class Act:
    """Something that the operator does, ``since_s`` seconds of mission clock after the departure."""

    since_s: float
    command: str


def is_operator(request: FaultRequest) -> bool:
    """Return whether it is the operator who acts, and nothing fails."""
    return request.what == OPERATOR


def acts_of(requests: Sequence[FaultRequest]) -> list[Act]:
    """Return what the operator does in a run with these faults, in the order of time; an act without a time is done at the departure.

    Raises:
        FaultError: an operator does no such thing.
    """
    found = []
    for request in filter(is_operator, requests):
        command = parse_fault(str(request), FAULTS).how or PAUSE
        found.append(Act(request.begin_s or 0.0, command))
        if command == PAUSE and request.end_s is not None:
            found.append(Act(request.end_s, RESUME))
    return sorted(found)


def on_time(requests: Sequence[FaultRequest], departed_s: float | None) -> dict[str, float]:
    """Return when each act began, seconds of mission clock, by the words of the fault without its times; nothing before the departure."""
    if departed_s is None:
        return {}
    return {f"{OPERATOR}:{request.how or PAUSE}": departed_s + (request.begin_s or 0.0) for request in filter(is_operator, requests)}
