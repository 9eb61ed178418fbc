"""Processes of a run that ended without being told to, as the supervisor writes them down."""

from __future__ import annotations

import contextlib
import signal
from dataclasses import asdict, dataclass
from pathlib import Path

from alula.common.run_log import DEATH, note, read


@dataclass(frozen=True)
class Death:
    """A process that ended without being told to.

    ``when_s``: absolute mission clock, None before it runs. ``respawned``: the launch file has it started again.
    """

    name: str
    how: str
    when_s: float | None
    respawned: bool = False

    def sentence(self) -> str:
        """Return what a person wants to read."""
        when = "" if self.when_s is None else f" at {self.when_s:.1f} s of mission clock"
        again = "; it was started again" if self.respawned else ""
        return f"{self.name} died ({self.how}){when}{again}"


def describe_exit(code: int | None) -> str:
    """Return ``signal SIGKILL`` or ``exit code 1``."""
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def note_death(out: Path, death: Death) -> None:
    """Write down that a process of a run died."""
    note(out, DEATH, asdict(death))


def read_deaths(out: Path) -> list[Death]:
    """Return which processes of a run died."""
    deaths = []
    for values in read(out, DEATH):
        with contextlib.suppress(TypeError):
            deaths.append(Death(**values))
    return deaths
