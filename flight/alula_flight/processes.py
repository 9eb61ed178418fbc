"""End every process of a run, whoever started it and however its parents died.

All processes of a run inherit ``ALULA_RUN_ID``; a process is of the run if, and only if, its environment carries that id.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import time
from pathlib import Path

RUN_ID_VARIABLE = "ALULA_RUN_ID"
SHARED_MEMORY = Path("/dev/shm")  # noqa: S108  (where POSIX puts it)


def processes_of_run(run_id: str) -> list[int]:
    """Return the ids of all living processes of the run, this one excepted; zombies don't count."""
    mark = f"{RUN_ID_VARIABLE}={run_id}".encode()
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        with contextlib.suppress(OSError):  # gone meanwhile, or another user's
            if mark in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
    return found


def end_run(run_id: str, *, patience_s: float = 3.0) -> list[int]:
    """End all processes of the run, first politely unless ``patience_s`` is 0, then for good; return those that had to be told."""
    told = processes_of_run(run_id)
    polite = [(signal.SIGTERM, patience_s)] if patience_s > 0.0 else []
    for send, wait_s in (*polite, (signal.SIGKILL, 5.0)):
        for process in processes_of_run(run_id):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, send)
        end = time.monotonic() + wait_s
        while processes_of_run(run_id) and time.monotonic() < end:
            time.sleep(0.05)
    return told


def sweep_shared_memory() -> int:
    """Remove the segments that killed DDS participants left behind; return how many.

    Fast DDS holds a lock on ``<segment>_el`` as long as a segment's owner lives; where the lock can be had, nobody does.
    """
    removed = 0
    for lock in SHARED_MEMORY.glob("fastrtps_*_el"):
        segment = lock.with_name(lock.name.removesuffix("_el"))
        with contextlib.suppress(OSError):
            descriptor = os.open(lock, os.O_RDWR)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                segment.unlink(missing_ok=True)
                lock.unlink(missing_ok=True)
                removed += 1
            finally:
                os.close(descriptor)
    return removed
