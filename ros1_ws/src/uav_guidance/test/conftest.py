"""Flights of the pure guidance, on the ground and in the air."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import cache

import pytest
from guidance_pure_flight import PureFlight


@cache
def in_the_air() -> PureFlight:
    """Return a flight at 3 m; to be copied, for a take-off is the same for all."""
    flight = PureFlight()
    flight.take_off()
    return flight


@pytest.fixture
def flight():
    return PureFlight()


@pytest.fixture
def flying():
    return deepcopy(in_the_air())


@pytest.fixture
def said(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """Return a function that returns what the guidance has logged; rospy's threads of earlier tests may log meanwhile."""
    return lambda: [record.getMessage() for record in caplog.records if record.name.startswith("uav_guidance.")]
