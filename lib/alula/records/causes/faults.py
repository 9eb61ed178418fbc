"""Trace the faults of a run: which resource changes show each, and which executions failed because of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from alula.common.faults import MENDED, FaultChange, FaultRequest, spans_of
from alula.mock import Behaviour
from alula.records.causes.effects import EffectsByFault, FaultEffects
from alula.records.causes.failures import SkillFailure, skill_failures
from alula.runtime.core.events import EngineEvent, TransitionEvent

EARLY_S = 0.05
"""The managers' clock ticks at 50 Hz: an event's stamp may be some ticks older than what caused it."""
LATE_S = 5.0
"""A fault that has ended can still show for so long: the timeout of the monitors, 3 s, and what they say has to arrive."""


@dataclass(frozen=True)
class Fault:
    """Something that failed, or a process that ended, from ``at_s`` to ``until_s``, seconds of mission clock.

    ``injected``: it was made to fail.
    """

    name: str
    at_s: float
    until_s: float = math.inf
    effects: FaultEffects = field(default_factory=FaultEffects)
    injected: bool = True

    def holds(self, t_s: float) -> bool:
        """Return whether what happened at this time can follow from it."""
        return self.at_s - EARLY_S <= t_s <= self.until_s + LATE_S


@dataclass(frozen=True)
class Traced:
    """A fault and its consequences, in the order of the events; ``changes`` are the resource changes that show it."""

    fault: Fault
    changes: tuple[TransitionEvent, ...] = ()
    failures: tuple[SkillFailure, ...] = ()

    @property
    def first(self) -> EngineEvent | None:
        """The first event that shows it; None: there is none."""
        events: list[EngineEvent] = [*self.changes, *(one.end for one in self.failures)]
        return min(events, key=lambda event: event.stamp_s, default=None)

    @property
    def detected_s(self) -> float | None:
        """When the skill layer detected it, seconds of mission clock; None: never."""
        return None if self.first is None else self.first.stamp_s

    @property
    def detected_by(self) -> str:
        """The change of a resource, or the end of a skill, that shows it first; empty: there is none."""
        event = self.first
        if event is None:
            return ""
        if isinstance(event, TransitionEvent):
            return f"{event.skillset}.{event.resource} {event.from_state} -> {event.to_state}"
        return f"{event.skillset}.{event.skill} {event.state.value} {event.result}".rstrip()


def faults_told(changes: Sequence[FaultChange], effects: EffectsByFault) -> list[tuple[FaultChange, Fault]]:
    """Return the faults in recordings, each with its change; a fault lasts until the next change of the same thing."""
    found = []
    for at, change in enumerate(changes):
        if change.mode != MENDED:
            until_s = next((later.t_s for later in changes[at + 1 :] if later.sensor == change.sensor), math.inf)
            found.append((change, Fault(change.sensor, change.t_s, until_s, effects.of(change.sensor))))
    return found


def faults_asked(
    requests: Sequence[FaultRequest],
    events: Sequence[EngineEvent],
    lift_off_s: float | None,
    effects: EffectsByFault,
    *,
    first_s: Mapping[str, float] | None = None,
    behaviour: Behaviour | None = None,
) -> list[tuple[FaultRequest, Fault]]:
    """Return the faults that were asked for and came, with their requests, in the order of time.

    Args:
        requests: as on the command line.
        events: of the run.
        lift_off_s: seconds of mission clock; None: it never lifted off.
        effects: of the robot's faults.
        first_s: what mocks say (see ``alula.common.faults.spans_of``).
        behaviour: of the mocks, which declares effects of faults.
    """
    stamps = [event.stamp_s for event in events]
    begun_s, ended_s = min(stamps, default=0.0), max(stamps, default=-math.inf)
    found = []
    for span in spans_of(requests, begun_s=begun_s, lift_off_s=lift_off_s, ended_s=ended_s, first_s=first_s):
        name = f"{span.request.what}:{span.request.how}" if span.request.how else span.request.what
        found.append((span.request, Fault(name, span.at_s, span.until_s, effects.of(name, behaviour))))
    return found


def trace(faults: Sequence[Fault], events: Sequence[EngineEvent]) -> list[Traced]:
    """Return what followed from each fault.

    A change of a resource follows from the last fault before it that can show so and had not ended long before; else from the last one
    that can lead to it later, which tells of nothing. A skill's failure follows from the fault behind the newest change that it names;
    one that names no change, from the last fault that holds and has such an end among its effects. Nothing follows from two faults,
    and what none explains from none.
    """
    causes = {at: cause for at, event in enumerate(events) if (cause := _cause(faults, event)) is not None}
    changes: list[list[TransitionEvent]] = [[] for _ in faults]
    for at, cause in causes.items():
        event = events[at]
        if isinstance(event, TransitionEvent) and faults[cause].effects.shows(event):
            changes[cause].append(event)
    failures: list[list[SkillFailure]] = [[] for _ in faults]
    for failure in skill_failures(events):
        behind = next((causes[at] for at in failure.behind if at in causes), None) if failure.behind else causes.get(failure.at)
        if behind is not None:
            failures[behind].append(failure)
    return [Traced(fault, tuple(changes[at]), tuple(failures[at])) for at, fault in enumerate(faults)]


def _cause(faults: Sequence[Fault], event: EngineEvent) -> int | None:
    """Return the index of the last fault that can have caused an event by itself."""
    holding = [at for at, fault in enumerate(faults) if fault.holds(event.stamp_s)]
    if isinstance(event, TransitionEvent):
        suspects = [at for at in holding if faults[at].effects.shows(event)] or [at for at in holding if faults[at].effects.leads_to(event)]
    else:
        suspects = [at for at in holding if faults[at].effects.stops(event)]
    return max(suspects, key=lambda at: faults[at].at_s, default=None)
