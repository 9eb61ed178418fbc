"""Shared memory that killed DDS participants left behind.

Fast DDS itself finds that the reader of a port is dead: whoever writes to the port looks each second whether its reader still counts. It
notes when it has looked last, on the wall clock (SharedMemGlobal.hpp of Fast DDS 2.14.5, `Port::WatchTask`). So after a clock was set back
by an hour nobody looks for an hour, and who wrote to a process that was killed does not reach the one that was started instead.
"""

from __future__ import annotations

import contextlib
import fcntl
import mmap
import os
import re
import struct
import time
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")  # noqa: S108  (where POSIX puts it)
PORTS = "fastrtps_port"
"""What the names of ports begin with. One is written to by all participants that know its number, also after its reader has died, and is
read by the next participant that takes that number: where it is removed meanwhile, what those write reaches nobody."""
SWEPT_AFTER_S = 5.0
"""Others may be creating segments: a lock that is younger may be one that was made and not taken yet."""
_PORT_ABI = b"port_node_abi5"
"""What the layout of `_PORT_NODE` belongs to."""
_PORT_NODE = re.compile(rb"(?=(.{4}).{4}(.{4})(.{4}).{8}(.{4}))", re.DOTALL)
"""In a port: its number, how many read it, after how many ms it is checked, a third of that, its capacity, how many wait, its flags."""
_IS_PORT_OK = 1


def sweep_shared_memory(*, older_than_s: float = SWEPT_AFTER_S) -> int:
    """Remove the segments whose owner is dead, and mark their ports; return how many segments were removed.

    Ports stay until Fast DDS makes them anew. Who still writes to a marked one looks for the new one.

    Fast DDS holds a lock on ``<segment>_el`` as long as a segment's owner lives; where the lock can be had, the owner is dead. Locks
    that are not older than ``older_than_s`` are left.
    """
    removed = 0
    for lock in SHARED_MEMORY.glob("fastrtps_*_el"):
        segment = lock.with_name(lock.name.removesuffix("_el"))
        is_port = segment.name.startswith(PORTS)
        with contextlib.suppress(OSError, ValueError):  # what is gone by now, and what is empty yet
            if time.time() - lock.stat().st_mtime < older_than_s:  # noqa: TID251 - a file's age is wall time
                continue
            descriptor = os.open(lock, os.O_RDWR)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if is_port:
                    _mark_dead(segment)
                    continue
                segment.unlink(missing_ok=True)
                lock.unlink(missing_ok=True)
                removed += 1
            finally:
                os.close(descriptor)
    return removed


def _mark_dead(port: Path) -> None:
    """Mark a port as one that is not in order, where its layout is the one that is known here."""
    number = struct.pack("<I", int(port.name.removeprefix(PORTS)))
    with port.open("r+b") as file, mmap.mmap(file.fileno(), 0) as memory:
        if memory.find(_PORT_ABI) < 0:
            return
        at = memory.find(number)
        while at >= 0:
            node = _PORT_NODE.match(memory, at)
            if node and int.from_bytes(node[2], "little") // 3 == int.from_bytes(node[3], "little") > 0:
                memory[node.start(4)] &= ~_IS_PORT_OK
            at = memory.find(number, at + 1)
