"""How much of the disk a deployment's missions and recordings take, and which of them go first."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

GB = 1e9
FREE_GB, FULL = 2.0, 0.9
"""It is told of a disk that has less left, and of a budget that is taken to that part."""


@dataclass(frozen=True)
class Kept:
    """A finished mission's folder, or a recording: when it was written last, seconds since 1970, and its size in bytes."""

    path: Path
    written_s: float
    size: int


def kept_of(runs: Path, bags: Path, deployment: str) -> list[Kept]:
    """Return what a deployment has left and is not being written: its finished missions, and its recordings."""
    found = [_kept(path) for path in bags.glob("*.bag")]
    for report in runs.glob("*/summary.json"):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            if json.loads((report.parent / "run.json").read_text(encoding="utf-8")).get("deployment") == deployment:
                found.append(_kept(report.parent))
    return found


def beyond(kept: Iterable[Kept], budget: float) -> list[Kept]:
    """Return what has to go so that the rest is within the budget in bytes: the oldest first, and never the newest."""
    oldest_first = sorted(kept, key=lambda one: one.written_s)
    size, gone = sum(one.size for one in oldest_first), []
    for one in oldest_first[:-1]:
        if size <= budget:
            break
        gone.append(one)
        size -= one.size
    return gone


def tidy(runs: Path, bags: Path, deployment: str, budget_gb: float) -> str:
    """Remove what is beyond the budget; return what is to be said of the disk, empty where there is room."""
    kept = kept_of(runs, bags, deployment)
    gone = beyond(kept, budget_gb * GB)
    for one in gone:
        if one.path.is_dir():
            shutil.rmtree(one.path, ignore_errors=True)
        else:
            one.path.unlink(missing_ok=True)
    taken_gb = sum(one.size for one in kept if one not in gone) / GB
    free_gb = shutil.disk_usage(bags).free / GB
    told = [f"{free_gb:.1f} GB are free: make room"] if free_gb < FREE_GB else []
    if taken_gb > FULL * budget_gb:
        told.append(f"missions and recordings take {taken_gb:.1f} of {budget_gb:g} GB (`record: disk_gb`): the oldest go next")
    return "; ".join(told)


def _kept(path: Path) -> Kept:
    files = [path] if path.is_file() else [one for one in path.rglob("*") if one.is_file()]
    return Kept(path, max((one.stat().st_mtime for one in files), default=0.0), sum(one.stat().st_size for one in files))
