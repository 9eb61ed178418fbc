"""Which process of a run died, how, and what that means for the run."""

from __future__ import annotations

import contextlib
import json
import signal
import threading
from dataclasses import asdict
from enum import Enum
from pathlib import Path

from alula.report.deaths import Death


class Consequence(Enum):
    """What the supervisor does when a process has died by itself."""

    GO_ON = "go on"  # roslaunch starts it again, or the run can do without
    ABORT = "abort the mission"  # the mission can still land the vehicle
    LAND = "land the vehicle"  # no mission decides any more
    END = "end the run"  # there is nothing left to fly


# A name that is not here: the run goes on.
CONSEQUENCES = {
    "mission": Consequence.LAND,
    "uav_simulator": Consequence.END,
    "master": Consequence.ABORT,
}


def describe_exit(code: int | None) -> str:
    """Return ``signal SIGKILL`` or ``exit code 1``."""
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


class DeathRecord:
    """Collects deaths from roslaunch's process monitor (any thread) and writes each at once to a file, a line each."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._deaths: list[Death] = []
        path.touch()

    def add(self, death: Death) -> None:
        """Keep a death and write it down."""
        with self._lock:
            self._deaths.append(death)
            # A disk that is full, or a folder that has gone, must not end the run.
            with contextlib.suppress(OSError), self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(death)) + "\n")

    @property
    def all(self) -> tuple[Death, ...]:
        """All deaths so far."""
        with self._lock:
            return tuple(self._deaths)
