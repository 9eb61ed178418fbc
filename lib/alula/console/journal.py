"""What the operator did: ``operator.jsonl`` in the run's folder, a line an act.

Not in ``skills.mcap``: the mission's process writes that, and two processes can't write one. Lines can be added after a restart.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

FILE = "operator.jsonl"


def note(folder: Path, stamp_s: float | None, act: Mapping[str, object]) -> None:
    """Write an act down: ``{command, by, answer}`` and what belongs to it; seconds of mission clock, None before that is heard."""
    stamp = {} if stamp_s is None else {"stamp_s": round(stamp_s, 3)}
    with (folder / FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps({**stamp, **act}) + "\n")
