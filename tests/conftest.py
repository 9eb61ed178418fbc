"""The order of these tests: whole flights come last, for they keep two cores busy when the other parts of the suite have ended."""

from __future__ import annotations

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put flights behind all else; the order is kept otherwise."""
    items.sort(key=lambda item: item.get_closest_marker("flight") is not None)
