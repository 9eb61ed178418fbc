"""Find a run's bag, and mend it when its recorder was killed before it wrote the index."""

from __future__ import annotations

import shutil
from pathlib import Path

import rosbag

from alula.common.files import write_aside
from alula.report.files import Problems, ReportError

BAG = "functional.bag"


def usable_bag(folder: Path, problems: Problems) -> rosbag.Bag | None:
    """Return an indexed bag, open, made from ``functional.bag.active`` if need be; None, with a problem noted, if there is none.

    It is the caller's to close. Opening it reads the index, which takes as long as reading the messages of the report.
    """
    finished = folder / BAG
    active = folder / f"{BAG}.active"
    bag = _indexed(finished) if finished.exists() else None
    if bag is not None:
        return bag
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
    return rosbag.Bag(str(finished))


def _indexed(path: Path) -> rosbag.Bag | None:
    """Return an open bag; None where it has no index, or no message."""
    try:
        bag = rosbag.Bag(str(path))
    except (rosbag.ROSBagException, OSError):
        return None
    if bag.get_message_count():
        return bag
    bag.close()
    return None


def _reindex_copy(damaged: Path, copy: Path) -> None:
    """Copy the bag and index the copy, dropping what lies behind its last whole chunk (as ``rosbag reindex`` does)."""
    shutil.copyfile(damaged, copy)
    with rosbag.Bag(str(copy), "a", allow_unindexed=True) as bag:
        for _ in bag.reindex():
            pass
    # Only what was written counts: the open bag also remembers messages of a chunk that it gave up halfway.
    recovered = _indexed(copy)
    if recovered is None:
        raise ReportError("it holds no whole chunk of messages")
    recovered.close()
