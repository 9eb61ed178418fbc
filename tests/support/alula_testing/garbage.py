"""A pytest plugin that keeps Python's collector of cycles from going through all tests and modules over and over while tests run."""

from __future__ import annotations

import gc

from alula.common.garbage import collect_seldom


def pytest_collection_finish() -> None:
    """Leave out what stays to the end, and look less often at what comes."""
    gc.collect()
    gc.freeze()
    collect_seldom()
