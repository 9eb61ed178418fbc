"""Puts generated files into a folder: everything is written aside first, then moved, so that nothing is ever half written."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path


def write_files(files: Mapping[str, str], out: Path) -> list[str]:
    """Write texts by relative path below ``out``; return the top-level entries that changed.

    An entry (a package's folder, a file) is replaced as a whole, and left alone with its time stamps when it holds the
    same already, so that builds don't repeat their work. Other entries of the folder are not touched.

    Raises:
        OSError: the folder can't be written; then every entry is as it was or as it should be.
    """
    out.mkdir(parents=True, exist_ok=True)
    entries: dict[str, dict[str, str]] = {}
    for path, text in files.items():
        entries.setdefault(path.split("/", 1)[0], {})[path] = text
    changed = [entry for entry, texts in entries.items() if not _holds(out, entry, texts)]
    # Hidden, so that no tool takes it for a package; in the same folder, so that moving is renaming.
    with tempfile.TemporaryDirectory(prefix=".generating-", dir=out) as staging:
        for entry in changed:
            for path, text in entries[entry].items():
                target = Path(staging, "new", path)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(text, encoding="utf-8", newline="\n")
        for entry in changed:
            _replace(Path(staging, "new", entry), out / entry, Path(staging, f"old-{entry}"))
    return changed


def prune(files: Mapping[str, str], out: Path) -> None:
    """Remove every entry of a folder that holds none of these files.

    Raises:
        OSError: one can't be removed.
    """
    wanted = {path.split("/", 1)[0] for path in files}
    for entry in out.iterdir():
        if entry.name in wanted:
            continue
        shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink()


def _replace(new: Path, place: Path, aside: Path) -> None:
    """Move ``new`` to ``place``, what was there before to ``aside``; put that back if the move fails."""
    if place.exists():
        _move(place, aside)
    try:
        _move(new, place)
    except OSError:
        if aside.exists():
            _move(aside, place)
        raise


def _move(source: Path, target: Path) -> None:
    """Rename; copy what the system can't rename: a folder of a lower layer, in containers."""
    try:
        source.rename(target)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        shutil.move(source, target)


def _holds(out: Path, entry: str, texts: Mapping[str, str]) -> bool:
    """Return whether an entry holds exactly these texts (what Python and editors leave aside does not count)."""
    place = out / entry
    if place.is_file():
        present = {entry}
    else:
        walked = (Path(folder, name) for folder, _, names in os.walk(place) for name in names)
        present = {path.relative_to(out).as_posix() for path in walked if "__pycache__" not in path.parts}
    if present != set(texts):
        return False
    return all((out / path).read_bytes() == text.encode() for path, text in texts.items())
