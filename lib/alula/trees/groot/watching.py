"""From a tree that is ticked to what viewers are shown and logs hold."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from alula.trees.groot.btlog import LogWriter
from alula.trees.groot.protocol import Status
from alula.trees.groot.states import NodeStates, Shown
from alula.trees.groot.tree_xml import tree_xml
from alula.trees.node import Node
from alula.trees.status import FAILURE, IDLE, RUNNING, SUCCESS
from alula.trees.status import Status as NodeStatus
from alula.trees.tree import Tree

NUMBERS = {id(one): number.value for one, number in zip((IDLE, RUNNING, SUCCESS, FAILURE), Status, strict=False)}
"""By identity: an Enum's hash is computed in Python, and many nodes change in a tick."""


class Watch:
    """Collects what changes in a tick, and hands it on when the tick is over: a change costs the mission next to nothing.

    ``clock_us``: mission clock, microseconds; of any thread.
    """

    def __init__(self, tree: Tree, clock_us: Callable[[], int]) -> None:
        xml = tree_xml(tree)
        states = NodeStates((node.uid for subtree in tree.subtrees for node in subtree.nodes), clock_us)
        self.shown = Shown(xml, states, {subtree.path or subtree.tree_id: subtree.blackboard.values for subtree in tree.subtrees})
        self._clock_us = clock_us
        self._log: LogWriter | None = None
        self._changes: list[tuple[Node, NodeStatus, NodeStatus]] = []
        add = self._changes.append
        self._end = tree.watch(lambda node, previous, status: add((node, previous, status)))

    def log(self, path: Path) -> None:
        """Have a log written from now on; raises OSError."""
        self._log = LogWriter(path, self.shown.xml, self._clock_us())

    def commit(self) -> None:
        """Hand on what has changed; to be called after each tick."""
        if not self._changes:
            return
        changes = [(node.uid, NUMBERS[id(previous)], NUMBERS[id(status)]) for node, previous, status in self._changes]
        self._changes.clear()
        now_us = self._clock_us()
        self.shown.states.take(changes, now_us)
        if self._log is not None:
            self._log.take(changes, now_us)

    def close(self) -> str:
        """Watch no more, and end the log; return what went wrong with it."""
        self.commit()
        self._end()
        if self._log is None:
            return ""
        self._log.close()
        return self._log.error
