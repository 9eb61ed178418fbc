"""A pytest plugin that tells how far a part of the suite is, and how long it still takes by what its tests took last time.

Lines go to the file descriptor that ``ALULA_TEST_PROGRESS`` names (the suite's standard error: pytest keeps the usual one to itself).
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

EVERY_S = 30.0
DESCRIPTOR = "ALULA_TEST_PROGRESS"


def time_left_s(last_s: Mapping[str, float], taken_s: Mapping[str, float], coming: Sequence[str]) -> float | None:
    """Estimate what the coming tests take, in seconds of wall clock; None where nothing is known of any test.

    A test counts as last time, times by how much those that have run took longer than then; one that is new, as the mean of all known.
    """
    both = [name for name in taken_s if name in last_s]
    known = {**last_s, **taken_s}
    if not known:
        return None
    before_s = sum(last_s[name] for name in both)
    pace = sum(taken_s[name] for name in both) / before_s if before_s else 1.0
    mean_s = sum(known.values()) / len(known)
    return pace * sum(last_s.get(name, mean_s) for name in coming)


def told(part: str, done: int, total: int, left_s: float | None) -> str:
    """Return one line of progress; the time left in minutes, or in seconds where that is less than two minutes."""
    if left_s is None:
        left = ""
    elif left_s < 120.0:
        left = f", {left_s:.0f} s left"
    else:
        left = f", {left_s / 60.0:.0f} min left"
    return f"alula test: {part}: {done} of {total}{left}\n"


class Progress:
    """Keeps what tests take, and tells it now and then."""

    def __init__(self, descriptor: int, part: str, record: Path) -> None:
        self._descriptor = descriptor
        self._part = part
        self._record = record
        self._last_s: dict[str, float] = json.loads(record.read_text(encoding="utf-8")) if record.exists() else {}
        self._taken_s: dict[str, float] = {}
        self._coming: list[str] = []
        self._told_s = time.monotonic()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Know what is coming."""
        self._coming = [item.nodeid for item in session.items]

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Take a test's time, fixtures included, and tell the progress when it is due."""
        begun_s = time.monotonic()
        yield
        self._taken_s[item.nodeid] = round(time.monotonic() - begun_s, 2)
        if time.monotonic() - self._told_s >= EVERY_S:
            self._told_s = time.monotonic()
            self._tell()

    def pytest_sessionfinish(self) -> None:
        """Keep what the tests took, beside what others took earlier."""
        self._record.parent.mkdir(parents=True, exist_ok=True)
        beside = self._record.with_suffix(f".{os.getpid()}")
        beside.write_text(json.dumps({**self._last_s, **self._taken_s}), encoding="utf-8")
        beside.replace(self._record)

    def _tell(self) -> None:
        done = len(self._taken_s)
        left_s = time_left_s(self._last_s, self._taken_s, self._coming[done:])
        os.write(self._descriptor, told(self._part, done, len(self._coming), left_s).encode())


def pytest_configure(config: pytest.Config) -> None:
    """Tell progress where the suite asks for it, as ``DESCRIPTOR:PART``."""
    wanted = os.environ.pop(DESCRIPTOR, "")
    if not wanted:
        return
    descriptor, _, part = wanted.partition(":")
    record = Path(os.environ["ALULA_STATE"]) / "test-seconds" / f"{part.replace(' ', '-')}.json"
    os.set_inheritable(int(descriptor), False)
    config.pluginmanager.register(Progress(int(descriptor), part, record), "alula-progress")
