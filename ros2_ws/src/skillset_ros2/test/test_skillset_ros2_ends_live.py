"""The end of an executor in a test: what it was given is done, so that results of goals that a close ends are sent."""

from __future__ import annotations

import threading

import pytest

pytest.importorskip("rclpy")

from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from skillset_ros2_rig import SOON_S, until

from alula_testing.ros2 import end_spinning, spin


@pytest.mark.parametrize("make", [SingleThreadedExecutor, lambda: MultiThreadedExecutor(num_threads=2)], ids=["single", "multi"])
def test_an_executor_that_ends_has_done_what_it_was_given(ros2_domain, make):
    executor, begun, done = make(), threading.Event(), []

    def busy() -> None:
        """Return when the end has been asked for: with one more task, or with a shutdown."""
        begun.set()
        until(lambda: len(executor._tasks) > 2 or executor._is_shutdown, "the executor is to end")

    async def result() -> None:
        done.append("sent")

    thread = threading.Thread(target=spin, args=(executor,), daemon=True)
    thread.start()
    executor.create_task(busy)
    assert begun.wait(SOON_S)
    executor.create_task(result)
    end_spinning(executor, thread)
    assert not thread.is_alive()
    assert done == ["sent"]
