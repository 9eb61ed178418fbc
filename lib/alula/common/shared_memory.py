"""Shared memory that killed DDS participants left behind."""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")  # noqa: S108  (where POSIX puts it)
PORTS = "fastrtps_port"
"""What the names of ports begin with. One is written to by all participants that know its number, also after its reader has died, and is
read by the next participant that takes that number: where it is removed meanwhile, what those write reaches nobody."""
SWEPT_AFTER_S = 5.0
"""Others may be creating segments: a lock that is younger may be one that was made and not taken yet."""


def sweep_shared_memory(*, older_than_s: float = SWEPT_AFTER_S) -> int:
    """Remove the segments whose owner is dead; return how many. Ports stay: Fast DDS makes a dead one anew itself.

    Fast DDS holds a lock on ``<segment>_el`` as long as a segment's owner lives; where the lock can be had, the owner is dead. Locks
    that are not older than ``older_than_s`` are left.
    """
    removed = 0
    for lock in SHARED_MEMORY.glob("fastrtps_*_el"):
        segment = lock.with_name(lock.name.removesuffix("_el"))
        if segment.name.startswith(PORTS):
            continue
        with contextlib.suppress(OSError):
            if time.time() - lock.stat().st_mtime < older_than_s:  # noqa: TID251 - a file's age is wall time
                continue
            descriptor = os.open(lock, os.O_RDWR)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                segment.unlink(missing_ok=True)
                lock.unlink(missing_ok=True)
                removed += 1
            finally:
                os.close(descriptor)
    return removed
