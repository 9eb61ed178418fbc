"""A finding about a mission with the run that shows it, which can be played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from alula.language.errors import Diagnostic
from alula.missions.director import Outcome
from alula.model.model import Skillset
from alula.prove.mission.state import Event, State
from alula.prove.mission.system import System


@dataclass(frozen=True)
class MissionRun:
    """A run of the search with what it comes to: the mission's outcome, and the states of ``skillset.resource`` that matter."""

    events: tuple[Event, ...]
    outcome: str
    states: tuple[tuple[str, str], ...]
    skillsets: tuple[Skillset, ...]
    why_any_order: str = ""
    """Why nodes of the robot's own do anything in it that their class need not do."""


def run_of(system: System, events: Sequence[Event], state: State) -> MissionRun:
    """Return a run that comes to a situation."""
    names = [f"{one.name}.{resource.name}" for one in system.skillsets for resource in one.resources]
    states = ((name, known) for name in names if (known := system.resource(state, name)) is not None)
    outcome = system.outcome(state) or Outcome.RUNNING
    return MissionRun(tuple(events), outcome.value, tuple(states), system.skillsets, system.own.why)


@dataclass(frozen=True)
class MissionFinding(Diagnostic):
    """A finding; ``run`` shows it, None where nothing is to be shown."""

    run: MissionRun | None = None

    @property
    def playable(self) -> bool:
        """Return whether `check --play` plays it."""
        return self.run is not None
