"""Processes of a run that ended without being told to, as the supervisor writes them down."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

FILE = "deaths.jsonl"
DIED = "died"
"""The way of failing of a process that ended without being told to."""


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


def read_deaths(path: Path) -> list[Death]:
    """Read what the supervisor wrote; a line cut off by a crash is left out."""
    deaths = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            deaths.append(Death(**json.loads(line)))
        except (json.JSONDecodeError, TypeError):
            continue
    return deaths
