"""Enumerators that a program registers for scripts: ``{"ROLE_LEADER": 1, ...}`` in a file of JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from alula.trees.errors import TreeError

NAME = re.compile(r"[A-Za-z_]\w*")
WRITE = 'write {"NAME": 1, ...}'


def read_enums(path: Path) -> Mapping[str, float]:
    """Return the numbers of enumerators by their names; raises TreeError."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TreeError(f"{path}: can't be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise TreeError(f"{path}: is no JSON: {error}; {WRITE}") from error
    if not isinstance(content, dict):
        raise TreeError(f"{path}: is no object; {WRITE}")
    for name, value in content.items():
        if not NAME.fullmatch(name):
            raise TreeError(f"{path}: '{name}' is no name that a script can use; {WRITE}")
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise TreeError(f"{path}: '{name}' is {json.dumps(value)}, no number; {WRITE}")
    return {name: float(value) for name, value in content.items()}
