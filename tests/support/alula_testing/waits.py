"""Waiting in tests for what other threads and processes bring."""

from __future__ import annotations

import time
from collections.abc import Callable

LOOK_S = 0.002
"""How often (wall clock) a condition is looked at: conditions read states of libraries that do not tell when these change."""


HANGS_S = 120.0
"""After so much wall clock what is waited for hangs: a node's imports alone take half a minute on a busy machine."""


def until(condition: Callable[[], object], what: str, timeout_s: float = HANGS_S, every_s: float = LOOK_S) -> None:
    """Return as soon as the condition holds; fail, naming ``what``, when it does not within the time (wall clock)."""
    end_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end_s, f"not within {timeout_s} s: {what}"
        time.sleep(every_s)
