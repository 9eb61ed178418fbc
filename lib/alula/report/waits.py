"""What a run waited for before it could begin, as its supervisor found it: ``waits.jsonl`` in the run's folder."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

FILE = "waits.jsonl"
"""A line for each thing when it is waited for, and one with ``over`` when it is there."""


def read_waits(out: Path) -> dict[str, bool]:
    """Read what was waited for, each with whether it came; a line cut off by a crash is left out."""
    found = {}
    for line in (out / FILE).read_text(encoding="utf-8").splitlines() if (out / FILE).exists() else []:
        with contextlib.suppress(ValueError, KeyError, TypeError):
            wait = json.loads(line)
            found[str(wait["for"])] = bool(wait["over"])
    return found
