"""A pytest plugin for the daily loop: what starts no graph, no browser and no flight, with fewer examples of each property."""

from __future__ import annotations

import pytest
from hypothesis import settings

from alula_testing.examples import PROFILE

LIVE = {"ros_master", "ros2_domain", "browser"}
"""Fixtures that start what a test of the daily loop does not wait for."""
MARKS = ("flight", "long")
EXAMPLES = 10

settings.register_profile("quick", settings.get_profile(PROFILE), max_examples=EXAMPLES)


def pytest_configure() -> None:
    """Look at fewer examples, where a test does not say itself how many."""
    settings.load_profile("quick")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is live or takes long."""
    left_out = [item for item in items if LIVE & set(getattr(item, "fixturenames", ())) or any(map(item.get_closest_marker, MARKS))]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        kept = set(items) - set(left_out)
        items[:] = [item for item in items if item in kept]
