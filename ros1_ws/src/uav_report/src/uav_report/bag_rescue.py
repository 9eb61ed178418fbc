"""Find a run's bag, and mend it when its recorder was killed before it wrote the index."""

from __future__ import annotations

import shutil
from pathlib import Path

import rosbag

from alula.common.files import write_aside
from alula.report.files import Problems, ReportError

BAG = "functional.bag"


def usable_bag(folder: Path, problems: Problems) -> Path | None:
    """Return an indexed bag, made from ``functional.bag.active`` if need be; None, with a problem noted, if there is none."""
    finished = folder / BAG
    active = folder / f"{BAG}.active"
    if finished.exists() and _is_indexed(finished):
        return finished
    damaged = finished if finished.exists() else active
    if not damaged.exists():
        problems.note(f"{BAG} is missing: nothing is known of the vehicle's true path")
        return None
    try:
        write_aside(finished, lambda aside: _reindex_copy(damaged, aside))
    except (rosbag.ROSBagException, OSError, ReportError) as error:
        problems.note(f"{damaged.name} was cut off and nothing could be recovered of it: {error}")
        return None
    problems.note(f"{damaged.name} was cut off; {BAG} holds what could be recovered of it")
    return finished


def _is_indexed(path: Path) -> bool:
    try:
        with rosbag.Bag(str(path)) as bag:
            return bool(bag.get_message_count())
    except (rosbag.ROSBagException, OSError):
        return False


def _reindex_copy(damaged: Path, copy: Path) -> None:
    """Copy the bag and index the copy, dropping what lies behind its last whole chunk (as ``rosbag reindex`` does)."""
    shutil.copyfile(damaged, copy)
    with rosbag.Bag(str(copy), "a", allow_unindexed=True) as bag:
        for _ in bag.reindex():
            pass
    # Only what was written counts: the open bag also remembers messages of a chunk that it gave up halfway.
    if not _is_indexed(copy):
        raise ReportError("it holds no whole chunk of messages")
