"""rclpy's executor for one thread, without the wake-ups that only executors of several threads need.

rclpy 7.1.6 wakes its executor when what an entity has was taken, and again when its callback has returned: another thread may wait
meanwhile, and is to wait for that entity again. With one thread, no wait is under way meanwhile. Each such wake-up is one more turn, in
which all entities of all nodes are collected and a wait set is made for them, in Python: two turns a message instead of one. The loop,
what is done with an entity, order, time-outs and exceptions are rclpy's. Two things are better than there: a future that a coroutine
awaits wakes the executor, from any thread; and what another thread destroys raises nothing from the wait.
"""

from __future__ import annotations

import importlib.metadata
import inspect
import math
import time
import weakref
from collections.abc import Callable
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future, Task
from rclpy.waitable import Waitable

RCLPY = "7.1.6"
"""The version whose handlers are known here, as pinned."""
KINDS = ("timer", "subscription", "guard_condition", "client", "service")
"""As a wait set calls them."""
FAILING_S, AGAIN_S = 1.0, 0.001
"""So long (wall clock) the wait may fail before that is raised; when it is tried again meanwhile."""
Take = Callable[[Any], Any]


class LastingWaitable(Waitable):  # type: ignore[misc]  # rclpy has no types
    """A waitable that holds no handle of rcl, so that nothing has to be kept from being destroyed while it is waited for.

    From Kilted on, rclpy leaves these two to each class.
    """

    def __enter__(self) -> None:
        """Keep nothing."""

    def __exit__(self, *_raised: object) -> None:
        """Let go of nothing."""


class RclpyExecutor(SingleThreadedExecutor):  # type: ignore[misc]  # rclpy has no types
    """Runs callbacks in the thread that spins it: rclpy's own executor, but for what another thread destroys while it waits."""

    @property
    def idle(self) -> bool:
        """Whether no task is left to be done, but for one that asks."""
        with self._tasks_lock:
            return all(_over(task) or task.executing() for task, _, _ in self._tasks)

    def can_execute(self, entity: Any) -> bool:
        """Return whether to wait for an entity: not for an action that a thread has destroyed and will take off its node's list."""
        return super().can_execute(entity) and not (isinstance(entity, Waitable) and _destroyed(entity))

    def wait_for_ready_callbacks(self, *args: Any, **kwargs: Any) -> Any:
        """Return what is to be run next, its entity and node. No callback runs in here, so what is raised is of the wait itself."""
        end_s = math.inf
        while True:
            try:
                return super().wait_for_ready_callbacks(*args, **kwargs)
            except (InvalidHandle, rclpy_implementation.RCLError):
                # Another thread has destroyed something between the look at it and the wait. What was ready is found so again.
                end_s = min(end_s, time.monotonic() + FAILING_S)
                if time.monotonic() > end_s:
                    raise
                time.sleep(AGAIN_S)


class SparingExecutor(RclpyExecutor):
    """Runs callbacks in the thread that spins it, and wakes itself only where a wait could miss something."""

    def __init__(self, *, context: Any = None) -> None:
        super().__init__(context=context)
        self._run: Task | None = None
        """What is run, or was last."""
        self._awaited: weakref.WeakSet[Future] = weakref.WeakSet()

    def wait_for_ready_callbacks(self, *args: Any, **kwargs: Any) -> Any:
        """Return what is to be run next, its entity and node."""
        self._follow(self._run)
        found = super().wait_for_ready_callbacks(*args, **kwargs)
        self._run = found[0]
        return found

    def _follow(self, task: Task | None) -> None:
        """Have the future that a task awaits wake the executor: rclpy looks at tasks when it is awake for something else."""
        future = None if task is None else _awaited(task)
        if future is not None and future not in self._awaited:
            self._awaited.add(future)
            future.add_done_callback(self._look_again)

    def _look_again(self, _settled: Future) -> None:
        self.wake()

    def _make_handler(self, entity: Any, node: Node, take: Take) -> Task:
        """Make the task that takes what an entity has and calls back; it is run at once."""

        def wake() -> None:
            """Have open tasks looked at twice, as rclpy does: one may bring what another awaits, no future, that was looked at before it.

            A task that ends while it is not run was cancelled, perhaps by another thread while this one waits.
            """
            if not task.executing() or any(other is not task and not _over(other) for other, _, _ in self._tasks):
                self.wake()

        async def handle() -> None:
            if self._is_shutdown or not entity.callback_group.beginning_execution(entity):
                return
            try:
                call = take(entity)
                wake()
                if call is not None:
                    await call()
            finally:
                entity.callback_group.ending_execution(entity)
                wake()

        task = Task(handle, executor=self)
        with self._tasks_lock:
            self._tasks.append((task, entity, node))
        return task


def _destroyed(entity: Waitable) -> bool:
    try:
        with entity:
            return False
    except InvalidHandle:
        return True


def _over(task: Task) -> bool:
    return bool(task.done() or task.cancelled())


def _awaited(task: Task) -> Future | None:
    """Return the future that a task which is suspended awaits; None where it awaits something else, or is over."""
    place = task._handler  # noqa: SLF001 - its coroutine
    while (inner := getattr(place, "cr_await", None) or getattr(place, "gi_yieldfrom", None)) is not None:
        place = inner
    awaited = inspect.getgeneratorlocals(place).get("self") if inspect.isgenerator(place) else None
    return awaited if isinstance(awaited, Future) else None


def executor_for(version: str) -> type[RclpyExecutor]:
    """Return the executor for a version of rclpy: with another one than the pinned, rclpy's own."""
    return SparingExecutor if version == RCLPY else RclpyExecutor


def _installed() -> str:
    """Return the version of the wheel that rclpy comes from; empty where it comes from elsewhere."""
    try:
        return importlib.metadata.version("ros-rclpy")
    except importlib.metadata.PackageNotFoundError:
        return ""


NodeExecutor = executor_for(_installed())
"""What managers, missions and clients spin on."""
