"""A pytest plugin for the ROS 2 world: ``ros2_domain`` gives this process a DDS domain of its own."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest

from alula_common.network import claim_domain


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


def spin(executor: Any) -> None:
    """Spin until the executor is shut down, in a thread of its own.

    rclpy 7.1.6 raises InvalidHandle where another thread destroys a subscription or a client that the executor is about to look at;
    it can go on afterwards, so tests may destroy what they made.
    """
    from rclpy.exceptions import InvalidHandle
    from rclpy.executors import ExternalShutdownException, ShutdownException

    while True:
        try:
            executor.spin()
        except InvalidHandle:
            continue
        except (ExternalShutdownException, ShutdownException):
            return
        return
