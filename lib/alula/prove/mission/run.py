"""A finding about a mission with the run that shows it, which can be played."""

from __future__ import annotations

from dataclasses import dataclass

from alula.language.errors import Diagnostic
from alula.model.model import Skillset
from alula.prove.mission.state import Event


@dataclass(frozen=True)
class MissionRun:
    """A run of the search with what it comes to: the mission's outcome, and the states of ``skillset.resource`` that matter."""

    events: tuple[Event, ...]
    outcome: str
    states: tuple[tuple[str, str], ...]
    skillsets: tuple[Skillset, ...]


@dataclass(frozen=True)
class MissionFinding(Diagnostic):
    """A finding; ``run`` shows it, None where nothing is to be shown."""

    run: MissionRun | None = None

    @property
    def playable(self) -> bool:
        """Tell whether `check --play` plays it."""
        return self.run is not None
