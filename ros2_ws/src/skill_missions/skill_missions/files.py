"""What the mission writes into the run's folder; what is written as a whole is written aside and renamed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

KINDS = {0: "EXECUTION", 1: "TRANSITION"}  # skillset_interfaces/Event.kind
EXECUTION_FIELDS = ("skill", "id", "state", "result", "message")
TRANSITION_FIELDS = ("resource", "from_state", "to_state", "cause")


def write_text(path: Path, text: str) -> None:
    """Replace a file in one step, so that nobody ever reads half of it."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Replace a JSON file in one step."""
    write_text(path, json.dumps(content, indent=1) + "\n")


def event_record(event: Any) -> dict[str, object]:
    """Return a skillset_interfaces/Event as it is written: ``stamp_s`` is mission clock, inputs and outputs are objects."""
    kind = KINDS.get(int(event.kind), str(event.kind))
    record: dict[str, object] = {
        "stamp_s": event.header.stamp.sec + event.header.stamp.nanosec / 1e9,
        "sequence": int(event.sequence),
        "skillset": event.skillset,
        "kind": kind,
    }
    fields = TRANSITION_FIELDS if kind == "TRANSITION" else EXECUTION_FIELDS
    record.update({name: getattr(event, name) for name in fields})
    if kind == "EXECUTION":
        record["inputs"] = json.loads(event.inputs_json or "{}")
        record["outputs"] = json.loads(event.outputs_json or "{}")
    return record


class EventLog:
    """``events.jsonl``: a line an event, written at once, so that a crash loses none."""

    def __init__(self, path: Path) -> None:
        self._file: TextIO = path.open("a", encoding="utf-8", buffering=1)

    def add(self, record: Mapping[str, object]) -> None:
        """Write a line."""
        self._file.write(json.dumps(record) + "\n")

    def close(self) -> None:
        """Write no more."""
        self._file.close()
