"""Who ended a run before its mission did, and why: ``ended.json`` in the run's folder, written once, by the first who does."""

from __future__ import annotations

import contextlib
import json
import signal
from dataclasses import asdict, dataclass
from pathlib import Path

FILE = "ended.json"
OPERATOR, SUPERVISOR, FRONT, SIGNAL = "operator", "supervisor", "front", "signal"
"""Who ends a run; SIGNAL: a program or a person outside of it."""


@dataclass(frozen=True)
class Ended:
    """``why`` in words for a person; ``when_s``: absolute mission clock, None where it is not known."""

    by: str
    why: str
    when_s: float | None = None

    def sentence(self) -> str:
        """Return what a person wants to read."""
        told = {OPERATOR: "aborted by the operator", SIGNAL: "aborted from outside"}
        return f"{told.get(self.by, f'ended by the {self.by}')}: {self.why}"


def ended_by_signal(number: signal.Signals | None) -> Ended:
    """Return what a signal to ``./alula fly`` means: SIGINT is the operator's Ctrl-C."""
    return Ended(SIGNAL, f"{number.name} to ./alula fly") if number not in {None, signal.SIGINT} else Ended(OPERATOR, "Ctrl-C")


def note_end(out: Path, ended: Ended) -> None:
    """Write down who ends the run, unless somebody else does already."""
    # A disk that is full, or a folder that is not there, must not end the run otherwise.
    with contextlib.suppress(OSError), (out / FILE).open("x", encoding="utf-8") as file:
        json.dump(asdict(ended), file)


def read_end(out: Path) -> Ended | None:
    """Return who ended the run; None: nobody did, or it is not known."""
    try:
        return Ended(**json.loads((out / FILE).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
