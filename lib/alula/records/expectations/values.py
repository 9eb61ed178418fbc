"""Expectations as values; each knows its place in the file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from alula.runtime.core.events import EngineEvent, TransitionEvent

TOLERANCE_S = 1.0


@dataclass(frozen=True)
class Pattern:
    """Events that are meant: ``navigation.takeoff TERMINATED LANDED``, ``takeoff RUNNING``, ``perception.zed_status BROKEN``.

    ``name`` is a skill or a resource, with or without its skillset; ``*`` stands for anything in every part.
    """

    name: str
    state: str
    result: str = ""

    def fits(self, event: EngineEvent) -> bool:
        """Return whether an event is meant."""
        if isinstance(event, TransitionEvent):
            subject, state, result = event.resource, event.to_state, ""
        else:
            subject, state, result = event.skill, event.state.value, event.result
        named = fnmatchcase(f"{event.skillset}.{subject}", self.name) or fnmatchcase(subject, self.name)
        return named and fnmatchcase(state, self.state) and (not self.result or fnmatchcase(result, self.result))

    def __str__(self) -> str:
        return f"{self.name} {self.state} {self.result}".rstrip()


@dataclass(frozen=True)
class ExpectedMoment:
    """An event that should happen, after those before it in the file. ``at_s`` counts from lift-off; None: at any time."""

    place: str
    pattern: Pattern
    at_s: float | None = None
    tolerance_s: float = TOLERANCE_S


@dataclass(frozen=True)
class States:
    """States that resources (``skillset.resource``) should be in ``at_s`` seconds after lift-off."""

    place: str
    at_s: float
    resources: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Never:
    """Events that must not happen; with ``after`` only once such an event was."""

    place: str
    pattern: Pattern
    after: Pattern | None = None


@dataclass(frozen=True)
class Expectations:
    """What a run should be.

    Attributes:
        outcomes: how the mission may end; empty: anyhow.
        order: groups of events, one after another; those of one group in any order.
        complete: whether no skill may start or end besides those in ``order``.
    """

    outcomes: tuple[str, ...] = ()
    outcome_place: str = ""
    order: Sequence[Sequence[ExpectedMoment]] = ()
    complete: bool = False
    complete_place: str = ""
    states: Sequence[States] = ()
    never: Sequence[Never] = field(default=())
