"""Read and write the processes of a run that died: ended without being asked to."""

from __future__ import annotations

import contextlib
import signal
from dataclasses import dataclass, replace
from pathlib import Path

from alula.common.run_log import AGAIN, DEATH, note, read
from alula.report.files import finite


@dataclass(frozen=True)
class Death:
    """A process that ended without a request to end.

    ``when_s``: absolute mission clock, None before it runs. ``again_s``: when it ran again, 0 before the mission clock runs; None: it
    stayed dead.
    """

    name: str
    how: str
    when_s: float | None
    again_s: float | None = None

    def sentence(self) -> str:
        """Return how it ended, in words."""
        return f"{self.name} died ({self.how}){_at(self.when_s)}"

    @property
    def fate(self) -> str:
        """Return in words whether it was restarted."""
        return "it stayed dead" if self.again_s is None else f"it was started again{_at(self.again_s or None)}"


def _at(mission_s: float | None) -> str:
    return "" if mission_s is None else f" at {mission_s:.1f} s of mission clock"


def describe_exit(code: int | None) -> str:
    """Return ``signal SIGKILL`` or ``exit code 1``."""
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def note_death(out: Path, death: Death) -> None:
    """Write down that a process of a run died; that it runs again is written by ``note_again``."""
    note(out, DEATH, {"name": death.name, "how": death.how, "when_s": death.when_s})


def note_again(out: Path, name: str, at_s: float | None) -> None:
    """Write down that a process that died runs again; seconds of mission clock, None before it runs."""
    note(out, AGAIN, {"name": name, "again_s": at_s or 0.0})


def read_deaths(out: Path) -> list[Death]:
    """Return the processes of a run that died, in that order, and whether each was restarted."""
    deaths = []
    for values in read(out, DEATH):
        with contextlib.suppress(TypeError):
            deaths.append(Death(**values))
    for values in read(out, AGAIN):
        at = next((at for at, one in enumerate(deaths) if one.name == values.get("name") and one.again_s is None), None)
        if at is not None:
            deaths[at] = replace(deaths[at], again_s=finite(values.get("again_s")))
    return deaths
