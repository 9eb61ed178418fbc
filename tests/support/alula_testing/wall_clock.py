"""A process whose wall clock the test sets, by Debian's ``libfaketime``; its monotonic clock goes on, as when NTP sets a computer's."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

LIBRARY = next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"), None)
needs_faketime = pytest.mark.skipif(LIBRARY is None, reason="the clock of a process can't be set here: apt install faketime")


class WallClock:
    """The wall clock of processes that get ``environment``."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "faketime"
        self.set_s = 0
        self.step(0)

    @property
    def environment(self) -> dict[str, str]:
        """Return what a process needs, the environment of this one included."""
        own = {"LD_PRELOAD": str(LIBRARY), "FAKETIME_TIMESTAMP_FILE": str(self._file), "FAKETIME_NO_CACHE": "1"}
        return {**os.environ, **own, "FAKETIME_DONT_FAKE_MONOTONIC": "1"}

    def step(self, by_s: int) -> None:
        """Set the clock forward, or back."""
        self.set_s += by_s
        new = self._file.with_suffix(".new")
        new.write_text(f"{self.set_s:+d}\n", encoding="ascii")
        new.replace(self._file)
