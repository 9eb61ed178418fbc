"""What the mission writes into the run's folder; what is written as a whole is written aside and renamed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from skill_runtime.core.events import EngineEvent, event_record


def write_text(path: Path, text: str) -> None:
    """Replace a file in one step, so that nobody ever reads half of it."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Replace a JSON file in one step."""
    write_text(path, json.dumps(content, indent=1) + "\n")


class EventLog:
    """``events.jsonl``: a line an event, written at once, so that a crash loses none."""

    def __init__(self, path: Path) -> None:
        self._file: TextIO = path.open("a", encoding="utf-8", buffering=1)

    def add(self, event: EngineEvent) -> None:
        """Write a line."""
        self._file.write(json.dumps(event_record(event)) + "\n")

    def close(self) -> None:
        """Write no more."""
        self._file.close()
