"""A cable that loses and delays frames, between two taps that it makes in its network namespace: ``bad_cable.py A B DELAY_S LOSS SEED``.

Each frame is lost with the probability ``LOSS``, by a generator with that seed, or comes out at the other end ``DELAY_S`` (monotonic clock)
later, in its order. It says ``ready`` when the taps are there. Taps, and no packet sockets: the kernel completes the checksums of what it
gives to a tap, and cuts it to the tap's MTU. To be run by any Python; it imports nothing of this package.
"""

from __future__ import annotations

import errno
import fcntl
import os
import random
import select
import struct
import sys
import time
from collections import deque

SET_INTERFACE, TAP, WITHOUT_HEADER = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
LONGEST_FRAME = 65536
DOWN = (errno.EIO, errno.ENETDOWN, errno.ENOBUFS)
"""Of a write while an end is not up, or full: the frame is lost, as on any cable."""


def make_tap(name: str) -> int:
    """Make a tap of this network namespace, which is there as long as the descriptor is open."""
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, SET_INTERFACE, struct.pack("16sH22x", name.encode("ascii"), TAP | WITHOUT_HEADER))
    return tap


def carry(taps: list[int], delay_s: float, loss: float, chance: random.Random) -> None:
    """Carry frames between two taps until the process is ended."""
    others = dict(zip(taps, reversed(taps), strict=True))
    waiting: deque[tuple[float, int, bytes]] = deque()
    while True:
        wait_s = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        for tap in select.select(taps, [], [], wait_s)[0]:
            frame = os.read(tap, LONGEST_FRAME)
            if chance.random() >= loss:
                waiting.append((time.monotonic() + delay_s, others[tap], frame))
        while waiting and waiting[0][0] <= time.monotonic():
            _, tap, frame = waiting.popleft()
            try:
                os.write(tap, frame)
            except OSError as error:
                if error.errno not in DOWN:
                    raise


def main(names: list[str], delay_s: float, loss: float, seed: int) -> None:
    """Make the taps, and carry."""
    taps = [make_tap(name) for name in names]
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    carry(taps, delay_s, loss, random.Random(seed))  # noqa: S311


if __name__ == "__main__":
    main(sys.argv[1:3], float(sys.argv[3]), float(sys.argv[4]), int(sys.argv[5]))
