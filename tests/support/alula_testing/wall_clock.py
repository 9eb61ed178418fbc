"""Processes whose wall clock the test sets (``wall_clock.c``); their monotonic clock goes on, as when NTP sets a computer's."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).with_suffix(".c")


class WallClock:
    """The wall clock of processes that get ``environment``; ``folder`` takes what they share."""

    def __init__(self, folder: Path) -> None:
        """Build the library that such processes load."""
        self._library, self._file = folder / "wall_clock.so", folder / "wall_clock"
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", str(self._library), str(SOURCE), "-ldl"], check=True)
        self.set_s = 0
        self._file.write_bytes(bytes(8))

    @property
    def variables(self) -> dict[str, str]:
        """Return the variables of the environment that a process needs."""
        return {"LD_PRELOAD": str(self._library), "WALL_CLOCK_SHIFT": str(self._file)}

    @property
    def environment(self) -> dict[str, str]:
        """Return what a process needs, the environment of this one included."""
        return {**os.environ, **self.variables}

    def step(self, by_s: int) -> None:
        """Set the clock forward, or back."""
        self.set_s += by_s
        with self._file.open("r+b") as file:
            file.write(self.set_s.to_bytes(8, sys.byteorder, signed=True))
