"""What must come when the world is calm: nothing fails any more, and the functional layer changes nothing by itself.

What was asked for arrives, interruptions are done, times pass, data stay as they are, and what else nobody knows is not against the
mission for ever. Failures may have happened before, any number of them. So something never comes after a situation where no calm step,
one after another, leads to it.
"""

from __future__ import annotations

from collections.abc import Callable

from alula.model.model import ResultKind
from alula.prove.mission.state import Event, Kind
from alula.prove.mission.system import System

CALM = frozenset({Kind.TICK, Kind.START, Kind.INTERRUPT})


def calm_of(system: System, *, terminating: bool) -> Callable[[Event], bool]:
    """Return the predicate of calm steps; executions end well some time where they are ``terminating``."""
    good = {
        f"{skillset.name}.{skill.name}": {result.name for result in skill.results if skill.kind_of(result.name) is ResultKind.SUCCESS}
        or {result.name for result in skill.results}
        for skillset in system.skillsets
        for skill in skillset.skills
    }

    def calm(event: Event) -> bool:
        if event.kind is Kind.REFUSE:
            return not event.failure
        return event.kind in CALM or (terminating and event.kind is Kind.RESULT and event.result in good[event.skill])

    return calm
