"""A pytest plugin for the ROS 2 world: ``ros2_domain`` gives this process a DDS domain of its own."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from alula.common.fast_dds import leave
from alula.common.network import claim_domain


@pytest.fixture(scope="session")
def ros2_domain() -> Iterator[int]:
    """Claim a domain and initialise rclpy in it; processes started afterwards inherit it."""
    import rclpy

    claim = claim_domain()
    os.environ["ROS_DOMAIN_ID"] = str(claim.domain)
    rclpy.init()
    # Of the tests' nodes in the default context none is the last: with that would go the participant in DDS, to be made again for the next.
    first = rclpy.create_node("tests", enable_rosout=False, start_parameter_services=False)
    yield claim.domain
    leave(first)
    claim.release()


def spin(executor: Any) -> None:
    """Spin until the executor is shut down or `end_spinning` is called, in a thread of its own.

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


def end_spinning(executor: Any, thread: threading.Thread, timeout_s: float = 5.0) -> None:
    """End a thread that runs `spin` as soon as the executor has done what it was given, and then the executor; wall clock in seconds.

    rclpy sends the result of a goal that has ended by a task of the executor: one that has not begun at the shutdown is lost, and Python
    warns of a coroutine that was never awaited. And the shutdown takes away what the thread may still be about to wait for.
    """
    if thread.is_alive():
        executor.create_task(_leave, executor).add_done_callback(lambda _: executor.wake())
        thread.join(timeout_s)
    executor.shutdown(timeout_sec=timeout_s)


class _OtherTasksFirst:
    """What a task awaits that lets all others of its executor run before it goes on; rclpy begins with the newest."""

    def __await__(self) -> Iterator[None]:
        yield


async def _leave(executor: Any) -> None:
    from rclpy.executors import ShutdownException

    executor.wake()
    await _OtherTasksFirst()
    raise ShutdownException
