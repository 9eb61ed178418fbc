"""Shared memory that killed DDS participants left behind.

Each participant reads from a port of its own, a file that all who write to it have mapped. Fast DDS (2.14.5) looks at the readers of a port
once a second, and misses two deaths. It looks only at readers that wait: one that was killed while it had a message in its hands counts as
well for ever (https://github.com/eProsima/Fast-DDS/pull/4728). And when it has looked last is noted on the wall clock: after that was set
back by an hour, nobody looks for an hour. The next participant with that number removes the dead one's file and makes another one, while
the others write on to what was removed, and are never heard again. A port that is marked as failed is opened anew by all who write to it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
import time
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")  # noqa: S108  (where POSIX puts it)
LOCKS = Path("/proc/locks")
PREFIX, LOCK = "fastrtps_", "_el"
PORTS = f"{PREFIX}port"
"""What the names of ports begin with. One is written to by all participants that know its number, also after its reader has died, and is
read by the next participant that takes that number: where it is removed meanwhile, what those write reaches nobody."""
SWEPT_AFTER_S = 5.0
"""Others may be creating segments: a lock that is younger may be one that was made and not taken yet."""
_LAYOUT = b"port_node_abi5\0"
"""In each port that is laid out as is known here."""
_NODE = struct.Struct("<6IB")
"""Number, readers, limits of a check and of a wait (ms), capacity, readers that wait; bits, the lowest of which says that it is well."""
_WELL = 1


def sweep_shared_memory(*, older_than_s: float = SWEPT_AFTER_S) -> int:
    """Remove the segments whose owner is dead, and mark ports whose reader is dead as failed; return how many were removed.

    To be called before a process joins DDS. Fast DDS holds a lock on ``<segment>_el`` as long as a segment's owner lives; where the lock
    can be had, the owner is dead. Locks that are not older than ``older_than_s`` are left.
    """
    fail_dead_ports()
    removed = 0
    for lock in SHARED_MEMORY.glob(f"{PREFIX}*{LOCK}"):
        segment = lock.with_name(lock.name.removesuffix(LOCK))
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


def fail_dead_ports() -> int:
    """Mark the ports whose reader is dead as failed, so that all who write to them open them anew; return how many were not yet.

    What the kernel lists as locked is not touched: the list lacks what processes of other PID namespaces hold, and a reader that finds
    its lock taken does not come to read.
    """
    held, failed = _held(), 0
    for lock in SHARED_MEMORY.glob(f"{PORTS}*{LOCK}"):
        with contextlib.suppress(OSError, ValueError):
            if _place(lock) not in held and _is_free(lock):
                port = lock.with_name(lock.name.removesuffix(LOCK))
                failed += _fail(port, int(port.name.removeprefix(PORTS)))
    return failed


def _held() -> set[str]:
    """Return which files are locked, as the kernel names them, as far as it says."""
    try:
        lines = LOCKS.read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return {words[-3] for words in map(str.split, lines) if len(words) >= 3}


def _place(file: Path) -> str:
    found = file.stat()
    return f"{os.major(found.st_dev):02x}:{os.minor(found.st_dev):02x}:{found.st_ino}"


def _is_free(lock: Path) -> bool:
    """Return whether a lock can be had."""
    descriptor = os.open(lock, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


def _fail(port: Path, number: int) -> bool:
    """Mark a port as failed, where it is one as known here; return whether it was well."""
    with port.open("r+b") as file:
        data = file.read()
        places = [place for place in range(0, len(data) - _NODE.size + 1, 4) if _is_node(data, place, number)]
        if _LAYOUT not in data or len(places) != 1:
            return False
        at = places[0] + _NODE.size - 1
        if not data[at] & _WELL:
            return False
        file.seek(at)
        file.write(bytes([data[at] & ~_WELL]))
    return True


def _is_node(data: bytes, place: int, number: int) -> bool:
    """Return whether what the port's number stands in front of is what Fast DDS keeps of it."""
    if data[place : place + 4] != number.to_bytes(4, "little"):
        return False
    _, _, check_ms, wait_ms, capacity, waiting, bits = _NODE.unpack_from(data, place)
    return bool(waiting <= capacity and 0 < wait_ms == check_ms // 3 and bits < 1 << 3)
