"""Ends a busy loop of rclpy's executor over Fast DDS.

A reader's status condition may be set after its message was taken already, because another entity had woken the executor: rmw_fastrtps
8.4.3 then returns from each wait at once, with nothing ready, until the reader is taken from again (rmw_fastrtps, issue 833).
For a topic that is quiet for long, that is a core at work for nothing.
"""

from __future__ import annotations

import contextlib
import time
import weakref
from typing import TYPE_CHECKING, Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.waitable import NumberOfEntities

from skillset_ros2.executor import KINDS, LastingWaitable

if TYPE_CHECKING:
    from rclpy.node import Node

AT_ONCE_S = 0.001
ROW = 3
"""So many waits one after the other that return at once with nothing are a busy loop."""
_WATCHED: weakref.WeakKeyDictionary[Node, EmptyWakes] = weakref.WeakKeyDictionary()


class EmptyWakes(LastingWaitable):
    """Sees what each wait of a node's executor brings; when that is nothing, again and again, takes from all readers once."""

    def __init__(self, node: Node) -> None:
        super().__init__(MutuallyExclusiveCallbackGroup())
        self._node = weakref.ref(node)
        self._begun_s = 0.0
        self._row = 0

    def get_num_entities(self) -> NumberOfEntities:
        """Return that it waits for nothing of its own."""
        return NumberOfEntities()

    def add_to_wait_set(self, wait_set: Any) -> None:  # noqa: ARG002 - rclpy's signature
        """Note that a wait begins."""
        self._begun_s = time.monotonic()

    def is_ready(self, wait_set: Any) -> bool:
        """Return whether the executor turns for nothing."""
        empty = time.monotonic() - self._begun_s < AT_ONCE_S and not any(wait_set.get_ready_entities(kind) for kind in KINDS)
        self._row = self._row + 1 if empty else 0
        return self._row >= ROW

    def take_data(self) -> None:
        """Begin to count empty turns anew; ``execute`` takes what the readers hold."""
        self._row = 0

    async def execute(self, _taken: None) -> None:
        """Take from each reader that the executor waits for; what was there is dealt with as ever."""
        node = self._node()
        executor = None if node is None else node.executor
        if node is None or executor is None:
            return
        takes = (
            (executor._take_subscription, node.subscriptions),  # noqa: SLF001 - rclpy 7.1.6 has no other way to take in a callback's order
            (executor._take_client, node.clients),  # noqa: SLF001
            (executor._take_service, node.services),  # noqa: SLF001
        )
        for take, entities in takes:
            for entity in list(entities):
                await _take(executor, take, entity)


async def _take(executor: Any, take: Any, entity: Any) -> None:
    """Do what the executor does with an entity that is ready."""
    if not executor.can_execute(entity) or not entity.callback_group.beginning_execution(entity):
        return
    try:
        with contextlib.suppress(InvalidHandle):
            call = take(entity)
            if call is not None:
                await call()
    finally:
        entity.callback_group.ending_execution(entity)


def watch_empty_wakes(node: Node) -> EmptyWakes:
    """End the busy loops of whatever executor spins the node; once a node."""
    if node not in _WATCHED:
        _WATCHED[node] = EmptyWakes(node)
        node.add_waitable(_WATCHED[node])
    return _WATCHED[node]
