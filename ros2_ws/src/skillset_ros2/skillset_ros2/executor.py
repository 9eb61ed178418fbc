"""An executor for nodes with many entities: it collects them when they change, not at each of its turns.

rclpy 7.1.6's own executor collects all entities of its nodes and makes a wait set for them before each wait, and it wakes itself after
each callback: two such turns a message, all in Python. rclcpp has the same idea under the same name. What is done with an entity that is
ready is rclpy's, and so are order, time-outs and exceptions.
"""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ConditionReachedException,
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
    TimeoutObject,
    timeout_sec_to_nsec,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Task

KINDS = ("timer", "subscription", "guard_condition", "client", "service")
"""As a wait set calls them, in the order in which those that are ready are dealt with; waitables come first."""
Take = Callable[[Any], Any]
Work = tuple[Any, Any, Node | None]
"""What is to be run, the entity that it is for, and the entity's node."""


class _Member(NamedTuple):
    """An entity that the executor waits for, as long as its callback group lets it be executed."""

    entity: Any
    handle: Any
    """Is entered while it is waited for, so that it is not destroyed meanwhile: the entity's handle, or the waitable itself."""
    add: Callable[[], object]
    """Adds it to the wait set."""


class _Collection(NamedTuple):
    """All entities of the nodes, and a wait set that has room for them."""

    wait_set: Any
    members: list[_Member]
    known: dict[str, dict[int, Any]]
    """The entities of each kind by the address of their handles, which is how a wait set names them."""
    nodes: dict[Any, Node]
    """The node of each entity."""


class _Call:
    """The work of one ready entity, in the shape that rclpy's ``spin_once`` runs: what it raises, is raised by the call."""

    def __init__(self, run: Callable[[], None]) -> None:
        self._run = run

    def __call__(self) -> None:
        self._run()

    def exception(self) -> None:
        """Return nothing."""

    def result(self) -> None:
        """Return nothing."""


class StaticSingleThreadedExecutor(SingleThreadedExecutor):  # type: ignore[misc]  # rclpy has no types
    """Runs callbacks in the thread that spins it."""

    def __init__(self, *, context: Any = None) -> None:
        self._changed = True
        self._collection: _Collection | None = None
        super().__init__(context=context)
        self._takes: dict[str, Take] = {
            "timer": self._take_timer,
            "subscription": self._take_subscription,
            "guard_condition": self._take_guard_condition,
            "client": self._take_client,
            "service": self._take_service,
        }

    @property
    def idle(self) -> bool:
        """Whether no task is left to be done, but for one that asks."""
        return not self._open_tasks()

    def wake(self) -> None:
        """Wake the executor because the entities of a node have changed, or what it is to wait for of them."""
        self._changed = True
        super().wake()

    def add_node(self, node: Node) -> bool:
        """Serve a node; False: it is served already."""
        added = bool(super().add_node(node))
        self.wake()
        return added

    def remove_node(self, node: Node) -> None:
        """Serve a node no more."""
        super().remove_node(node)
        self.wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Spin no more; False: what runs did not end in time."""
        ended = bool(super().shutdown(timeout_sec))
        self._collection = None
        return ended

    def _wait_for_ready_callbacks(
        self,
        timeout_sec: float | TimeoutObject | None = None,
        nodes: list[Node] | None = None,  # noqa: ARG002 - rclpy's signature; it is always None here
        condition: Callable[[], bool] = lambda: False,
    ) -> Iterator[Work]:
        """Yield what is to be run: what was begun and is not done, then what a wait has found ready."""
        timeout_ns = timeout_sec_to_nsec(timeout_sec.timeout if isinstance(timeout_sec, TimeoutObject) else timeout_sec)
        end_ns = time.monotonic_ns() + timeout_ns
        worked = False
        while not (worked or self._is_shutdown or condition()):
            tasks = self._open_tasks()
            for work in tasks:
                worked = True
                yield work
            # What a task has brought to its end, another one may await that was looked at before it.
            ended = any(task.done() for task, _, _ in tasks)
            for work in self._wait(0 if ended else timeout_ns if timeout_ns <= 0 else max(0, end_ns - time.monotonic_ns())):
                worked = True
                yield work
            if timeout_ns >= 0 and time.monotonic_ns() >= end_ns:
                raise TimeoutException
        if self._is_shutdown:
            raise ShutdownException
        if condition():
            raise ConditionReachedException

    def _open_tasks(self) -> list[Work]:
        """Return the tasks that are not done, the newest first."""
        with self._tasks_lock:
            self._tasks[:] = [work for work in self._tasks if not (work[0].done() or work[0].cancelled())]
            return [work for work in reversed(self._tasks) if not work[0].executing()]

    def _collect(self) -> _Collection:
        """Collect the entities of all nodes."""
        self._changed = False  # first: what changes from here on is collected the next time
        nodes = self.get_nodes()
        lists = {
            "timer": [(timer, node) for node in nodes for timer in node.timers],
            "subscription": [(subscription, node) for node in nodes for subscription in node.subscriptions],
            "guard_condition": [(guard, node) for node in nodes for guard in node.guards],
            "client": [(client, node) for node in nodes for client in node.clients],
            "service": [(service, node) for node in nodes for service in node.services],
        }
        waitables = [(waitable, node) for node in nodes for waitable in node.waitables]
        inside = [waitable.get_num_entities() for waitable, _ in waitables]
        guards = len(lists["guard_condition"]) + len(self._own_guards())
        wait_set = rclpy_implementation.WaitSet(
            len(lists["subscription"]) + sum(number.num_subscriptions for number in inside),
            guards + sum(number.num_guard_conditions for number in inside),
            len(lists["timer"]) + sum(number.num_timers for number in inside),
            len(lists["client"]) + sum(number.num_clients for number in inside),
            len(lists["service"]) + sum(number.num_services for number in inside),
            sum(number.num_events for number in inside),
            self._context.handle,
        )
        collection = _Collection(wait_set, [], {kind: {} for kind in KINDS}, {})
        for waitable, node in waitables:
            collection.members.append(_Member(waitable, waitable, functools.partial(waitable.add_to_wait_set, wait_set)))
            collection.nodes[waitable] = node
        for kind, entities in lists.items():
            add = getattr(wait_set, f"add_{kind}")
            for entity, node in entities:
                with contextlib.suppress(InvalidHandle):
                    collection.known[kind][entity.handle.pointer] = entity
                    collection.members.append(_Member(entity, entity.handle, functools.partial(add, entity.handle)))
                    collection.nodes[entity] = node
        return collection

    def _own_guards(self) -> tuple[Any, Any]:
        """Return what wakes this executor: its own guard, and that of signals."""
        guard, signals = self._guard, self._sigint_gc
        if guard is None or signals is None:
            raise ShutdownException
        return guard, signals

    def _wait(self, timeout_ns: int) -> list[Work]:
        """Wait until an entity is ready, or the executor is woken; return what is to be run."""
        collection = self._collection
        if self._changed or collection is None:
            collection = self._collection = self._collect()
        wait_set = collection.wait_set
        entered: list[Any] = []
        try:
            waited = self._fill(collection, entered)
            wait_set.wait(timeout_ns)
            if self._is_shutdown:
                raise ShutdownException
            if not self._context.ok():
                raise ExternalShutdownException
            ready = [(entity, self._take_waitable) for entity in waited if entity.is_ready(wait_set)]
            for kind in KINDS:
                known, take = collection.known[kind], self._takes[kind]
                ready += [(known[address], take) for address in wait_set.get_ready_entities(kind) if address in known]
        finally:
            for handle in entered:
                handle.__exit__(None, None, None)
        for entity, take in ready:
            if take == self._takes["guard_condition"]:
                entity._executor_triggered = True  # noqa: SLF001 - rclpy's own note: the wait has reset the guard, nothing has run yet
        nodes = collection.nodes
        return [(_Call(functools.partial(self._run, entity, take, nodes[entity])), entity, nodes[entity]) for entity, take in ready]

    def _fill(self, collection: _Collection, entered: list[Any]) -> list[Any]:
        """Fill the wait set with what may be executed now; return the waitables that are in it."""
        wait_set = collection.wait_set
        wait_set.clear_entities()
        for guard in self._own_guards():
            try:
                guard.handle.__enter__()
            except InvalidHandle:  # nothing could wake the wait
                raise ShutdownException from None
            entered.append(guard.handle)
            wait_set.add_guard_condition(guard.handle)
        for guard in collection.known["guard_condition"].values():
            if guard._executor_triggered:  # noqa: SLF001 - a caller with another time-out has dropped what was ready
                with contextlib.suppress(InvalidHandle):
                    guard.trigger()
        waitables: list[Any] = []
        for entity, handle, add in collection.members:
            if not entity.callback_group.can_execute(entity):
                continue
            try:
                handle.__enter__()
            except InvalidHandle:  # destroyed by another thread, which wakes the executor
                continue
            entered.append(handle)
            add()
            if handle is entity:
                waitables.append(entity)
        return waitables

    def _run(self, entity: Any, take: Take, node: Node) -> None:
        """Take what an entity has, and call back; what awaits something goes on as a task."""
        if not entity.callback_group.beginning_execution(entity):
            return
        work = _work(entity, take)
        try:
            work.send(None)
        except StopIteration:
            return
        with self._tasks_lock:
            self._tasks.append((Task(work, executor=self), entity, node))

    def _take_timer(self, timer: Any) -> Any:
        """Take a timer that is still due: one that an earlier callback has cancelled was found ready, too."""
        try:
            return super()._take_timer(timer) if timer.is_ready() else None
        except InvalidHandle:
            return None


async def _work(entity: Any, take: Take) -> None:
    try:
        call = take(entity)
        if call is not None:
            await call()
    finally:
        entity.callback_group.ending_execution(entity)
