"""Enumerators that a program registers for scripts: ``{"ROLE_LEADER": 1, ...}`` in a file of JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from alula.common.errors import AlulaError
from alula.common.json_files import read_object
from alula.trees.errors import TreeError

NAME = re.compile(r"[A-Za-z_]\w*")
FORM = '{"NAME": 1, ...}'


def read_enums(path: Path) -> Mapping[str, float]:
    """Return the numbers of enumerators by their names; raises TreeError."""
    return enums_of(read_object(path, TreeError, FORM), str(path), TreeError)


def enums_of(content: Mapping[str, object], where: str, error: Callable[[str], AlulaError]) -> dict[str, float]:
    """Return the numbers of enumerators that an object of JSON holds; raises what ``error`` makes, which begins with ``where``."""
    found: dict[str, float] = {}
    for name, value in content.items():
        if not NAME.fullmatch(name):
            raise error(f"{where}: '{name}' is no name that a script can use; write {FORM}")
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise error(f"{where}: '{name}' is {json.dumps(value)}, no number; write {FORM}")
        found[name] = float(value)
    return found
