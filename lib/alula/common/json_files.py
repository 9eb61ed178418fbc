"""Reads files of JSON that people write."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from alula.common.errors import AlulaError


def read_object(path: Path, error: Callable[[str], AlulaError], write: str) -> dict[str, object]:
    """Return the object that a file holds.

    Args:
        path: the file, UTF-8.
        error: makes the error of whoever reads it.
        write: what a message says to write instead, as ``{"NAME": 1, ...}``.

    Raises:
        AlulaError: what ``error`` makes: the file can't be read, or is no object of JSON.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as wrong:
        raise error(f"{path}: can't be read: {wrong.strerror or wrong}") from wrong
    except (ValueError, RecursionError) as wrong:
        raise error(f"{path}: is no JSON: {wrong}; write {write}") from wrong
    if not isinstance(content, dict):
        raise error(f"{path}: is no object; write {write}")
    return content
