"""``run_log.jsonl`` in a run's folder: what happened to a run besides its mission, a line each, by whatever process comes to know it.

Processes that died, what was done to processes, what the run waited for before it could begin, and who ended it.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FILE = "run_log.jsonl"
DEATH, FAULT, WAIT, END = "death", "fault", "wait", "end"
"""The kinds of lines: see ``deaths``, ``alula.common.faults.FaultChange``, ``read_waits`` and ``ends``."""


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
