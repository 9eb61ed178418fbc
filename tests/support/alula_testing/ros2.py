"""A pytest plugin for the ROS 2 world: ``ros2_domain`` gives this process a DDS domain of its own."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from alula_flight.claims import claim_domain


@pytest.fixture(scope="session")
def ros2_domain() -> Iterator[int]:
    """Claim a domain and initialise rclpy in it; processes started afterwards inherit it."""
    import rclpy

    claim = claim_domain()
    os.environ["ROS_DOMAIN_ID"] = str(claim.domain)
    rclpy.init()
    yield claim.domain
    rclpy.try_shutdown()
    claim.release()
