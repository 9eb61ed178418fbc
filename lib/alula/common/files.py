"""Write files that no crash can cut off: the final name never holds half a file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path

from alula.common.errors import AlulaError


def write_aside(path: Path, write: Callable[[Path], None]) -> None:
    """Let ``write`` make the file under a hidden name with the same suffix, then rename it; raises what ``write`` raises."""
    aside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(aside)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def check_place(option: str, path: Path | None) -> None:
    """Raise AlulaError where no file can be written to what an option names; before the work whose result it is for."""
    if path is None:
        return
    folder = path.absolute().parent
    if path.is_dir():
        raise AlulaError(f"{option} {path}: is a folder; name a file in it")
    if not folder.is_dir():
        raise AlulaError(f"{option} {path}: there is no folder {folder}; make it, or name another file")
    if not os.access(folder, os.W_OK):
        raise AlulaError(f"{option} {path}: {folder} can't be written to; name a file elsewhere")


def folder_there(folder: Path) -> Path:
    """Return the folder, or the nearest one above it that exists: where a folder that is still to be made takes its room from."""
    return next(one for one in (folder, *folder.absolute().parents) if one.is_dir())


def write_text(path: Path, text: str) -> None:
    """Replace a text file (UTF-8) in one step."""

    def write(aside: Path) -> None:
        aside.write_text(text, encoding="utf-8")

    write_aside(path, write)


def strict(value: object) -> object:
    """Return a copy of a JSON value with null where it holds NaN or infinities, which JSON does not have."""
    match value:
        case dict():
            return {str(key): strict(entry) for key, entry in value.items()}
        case list() | tuple():
            return [strict(entry) for entry in value]
        case float() if not math.isfinite(value):
            return None
        case _:
            return value


def json_line(value: object) -> str:
    """Return a value as a line of strict JSON, as all commands print their results with ``--json``."""
    return json.dumps(strict(value), allow_nan=False) + "\n"


def write_json(path: Path, value: object) -> None:
    """Replace a file with strict JSON in one step."""
    write_text(path, json.dumps(strict(value), indent=2, allow_nan=False) + "\n")
