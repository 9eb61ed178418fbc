"""How a thread waits for what an rclpy node brings: as long as the node is spun, and never by its own spinning thread."""

from __future__ import annotations

import inspect
import math
import threading
import time
from typing import Any

from rclpy.node import Node

from alula.runtime.waiting import CannotWaitError
from skillset_ros2.executor import NodeExecutor

LOOK_S = 0.5
"""How often (wall clock) a wait looks whether the node is still spun."""
SPIN_S = 5.0
"""How long (wall clock) a wait spins a node that no other thread spins, before it looks again."""
PULSE_S = 30.0
"""A node whose executor turns nothing for so long (wall clock) is not spun any more."""


def executor_of(node: Node) -> Any:
    """Return the executor that has the node; None when there is none (rclpy remembers one that has given it up)."""
    executor = node.executor
    return executor if executor is not None and node in executor.get_nodes() else None


def spins_here(executor: object) -> bool:
    """Return whether this thread is inside a callback, or any other part, of the executor's ``spin``."""
    frame = inspect.currentframe()
    while frame is not None:
        # By name: in the threads of an executor that has several, frames of its handlers know it, too.
        spins = frame.f_code.co_name.lstrip("_").startswith("spin") and frame.f_globals.get("__name__") == "rclpy.executors"
        if spins and frame.f_locals.get("self") is executor:
            return True
        frame = frame.f_back
    return False


class NodeWaiter:
    """Waits while others spin the node; spins it when it is not spun."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait (wall clock) for the event; None: while the node is spun.

        Raises:
            CannotWaitError: this thread spins the node itself, or the node is not spun any more.
        """
        end = None if timeout_s is None else time.monotonic() + timeout_s
        pulse = _Pulse()
        while not event.is_set() and (end is None or time.monotonic() < end):
            if not self._node.context.ok():
                raise CannotWaitError("ROS 2 has been shut down in this process; nothing arrives any more")
            left_s = math.inf if end is None else max(0.0, end - time.monotonic())
            executor = executor_of(self._node)
            if executor is None:
                self._spin(event, min(SPIN_S, left_s))
                continue
            if spins_here(executor):
                raise CannotWaitError(
                    f"this thread spins the node {self._node.get_name()} and can't wait for what only its spinning brings: "
                    "await it, give it a callback, or wait in another thread"
                )
            if not event.wait(min(LOOK_S, left_s)) and end is None:
                pulse.check(executor)
        return event.is_set()

    def _spin(self, event: threading.Event, time_s: float) -> None:
        """Spin the node in an executor of its own until the event, the time, or until another executor takes the node."""
        executor = NodeExecutor(context=self._node.context)
        executor.add_node(self._node)
        end = time.monotonic() + time_s
        try:
            while not event.is_set() and self._node.executor is executor and (left := end - time.monotonic()) > 0:
                executor.spin_once(timeout_sec=left)
        finally:
            executor.remove_node(self._node)
            executor.shutdown()
            if self._node.executor is executor:
                self._node.executor = None


class _Pulse:
    """Notices that an executor does not turn."""

    def __init__(self) -> None:
        self._felt = threading.Event()
        self._asked_s: float | None = None

    def check(self, executor: Any) -> None:
        """Have the executor give a sign now and then; raise CannotWaitError when one stays away."""
        if executor._is_shutdown:  # noqa: SLF001 - rclpy 7.1.6 has no question for it
            raise CannotWaitError("the node's executor was shut down; nothing arrives any more")
        now_s = time.monotonic()
        if self._felt.is_set():
            self._felt.clear()
            self._asked_s = None
        elif self._asked_s is None:
            self._asked_s = now_s
            executor.create_task(self._felt.set)
        elif now_s - self._asked_s > PULSE_S:
            raise CannotWaitError(f"the node's executor was not spun for {PULSE_S:g} s; nothing arrives any more")
