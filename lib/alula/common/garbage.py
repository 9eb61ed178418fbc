"""Python's collector of cycles, for what makes many objects that stay: it goes through all of them again and again."""

from __future__ import annotations

import gc

THRESHOLDS = (10_000, 50, 10)
"""How many objects come before the youngest are looked at; how many times that, before the older and the oldest ones."""


def collect_seldom() -> None:
    """Make the garbage collector run less often in this process: only cycles need it."""
    gc.set_threshold(*THRESHOLDS)
