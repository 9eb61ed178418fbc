"""A pytest plugin that keeps Python's collector of cycles from going through all tests and modules over and over while tests run."""

from __future__ import annotations

import gc

THRESHOLDS = (10_000, 50, 10)
"""How many objects are made before the youngest are looked at, and how many times that before the older ones."""


def pytest_collection_finish() -> None:
    """Leave out what stays to the end, and look less often at what comes."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(*THRESHOLDS)
