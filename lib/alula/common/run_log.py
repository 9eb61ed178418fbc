"""``run_log.jsonl`` in a run's folder: what happened to a run besides its mission, a line each, by whatever process comes to know it.

Processes that died, what was made to fail besides measurements, what the run waited for before it could begin, what the operator did, and
who ended it; of a run over mocks, how fast it was. ``skills.mcap`` is the mission's process's: two can't write one.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from alula.common import record
from alula.common.faults import FaultChange
from alula.common.record import Entry

FILE = "run_log.jsonl"
PICTURES_FILE = "pictures.jsonl"
"""Beside it: small pictures of what the robot's cameras see, a line each, ``{stamp_s, camera, jpeg}``."""
DEATH, AGAIN, FAULT, WAIT, HELD, ACT = "death", "again", "fault", "wait", "held", "act"
END, MOCKED, MISSION = "end", "mocked", "mission"
"""The kinds of lines: see ``alula.report.deaths``, ``alula.common.faults.FaultChange``, ``read_waits``, ``note_held``, ``note_act``,
``alula.report.aborts``, ``note_mocked`` and ``account``."""


def note(out: Path, kind: str, content: Mapping[str, object]) -> None:
    """Add a line. A disk that is full, or a folder that has gone, must not end a run: then there is none."""
    with contextlib.suppress(OSError), (out / FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"kind": kind, **content}) + "\n")


def read(out: Path, kind: str) -> list[dict[str, Any]]:
    """Return what was noted of a kind; a line cut off by a crash is left out."""
    try:
        lines = (out / FILE).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []
    found = []
    for line in lines:
        with contextlib.suppress(ValueError):
            content = json.loads(line)
            if isinstance(content, dict) and content.pop("kind", "") == kind:
                found.append(content)
    return found


def note_wait(out: Path, what: str, *, over: bool) -> None:
    """Note that a run waits for something before it can begin, or that it is there."""
    note(out, WAIT, {"for": what, "over": over})


def read_waits(out: Path) -> dict[str, bool]:
    """Return what a run waited for, each with whether it came."""
    return {str(one.get("for")): bool(one.get("over")) for one in read(out, WAIT)}


def note_held(out: Path, stamp_s: float, how: str) -> None:
    """Note that somebody else has the robot, which is not at rest, and how it is; seconds of mission clock."""
    note(out, HELD, {"stamp_s": round(stamp_s, 3), "how": how})


def read_held(out: Path) -> list[str]:
    """Return what was noted of a robot that somebody else had, in order."""
    return [str(one.get("how")) for one in read(out, HELD)]


def note_act(out: Path, stamp_s: float | None, act: Mapping[str, object]) -> None:
    """Note an act of the operator: ``{command, by, answer}``; seconds of mission clock, None before the clock is received."""
    note(out, ACT, {**({} if stamp_s is None else {"stamp_s": round(stamp_s, 3)}), **act})


def note_mocked(out: Path, simulated_s: float, wall_s: float, faults: Iterable[FaultChange], notes: Sequence[str]) -> None:
    """Note what a run over mocks has in place of recordings: its faults, seconds of mission clock, errors, and its speed."""
    for change in faults:
        note(out, FAULT, vars(change))
    note(out, MOCKED, {"simulated_s": simulated_s, "wall_s": wall_s, "factor": simulated_s / wall_s if wall_s else None, "notes": [*notes]})


def account(out: Path, entries: Iterable[Entry]) -> Mapping[str, Any]:
    """Return the mission's last account of its task and outcome, of a run with this record; empty where there is none.

    It is in the record; a mission whose record ended early, on a full disk say, notes it here.
    """
    told = [*(entry.value for entry in entries if entry.topic == record.MISSION), *read(out, MISSION)]
    return told[-1] if told else {}
