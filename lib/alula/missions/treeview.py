"""The tree as it is and as it went: for the console (JSON) and for the report (SVG)."""

from __future__ import annotations

import operator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from alula.missions.leaves import skill_leaf
from alula.trees.node import Node
from alula.trees.view import NodeView, kind_of, source_of

INTERRUPTED = "INTERRUPTED"


def path_of(node: Behaviour) -> tuple[str, ...]:
    """Return the names of the nodes from the root down to one."""
    above = () if node.parent is None else path_of(node.parent)
    return (*above, str(node.name))


class _Memory:
    """What one node last was; ``left``: while it was running, by a tick that did not come to it. ``view``: as it was looked at last."""

    __slots__ = ("kind", "left", "message", "node", "skill", "source", "status", "view")

    def __init__(self, node: Behaviour) -> None:
        self.node = node
        leaf = skill_leaf(node)
        self.kind, self.skill = kind_of(node) if isinstance(node, Node) else "action", "" if leaf is None else leaf.skill_name
        self.source = source_of(node) if isinstance(node, Node) else None
        self.status = Status.INVALID
        self.left = False
        self.message = ""
        self.view: NodeView | None = None


class TreeWatch:
    """Remembers what each node last was: py_trees forgets it when it leaves a branch. To be asked, or told, after each tick."""

    def __init__(self, root: Behaviour) -> None:
        self._root = root
        self._memories = {node: _Memory(node) for node in root.iterate()}
        self._as_looked_at = False
        """Whether nothing has changed since the last look."""
        if isinstance(root, Node):
            root.watchers.append(self._changed)  # its nodes are idle again before a tick ends

    def remember(self) -> None:
        """Take note of the tree now."""
        if isinstance(self._root, Node):
            for memory in self._memories.values():
                if memory.status is Status.RUNNING and not memory.left and memory.message != memory.node.feedback_message:
                    memory.message = memory.node.feedback_message
                    self._as_looked_at = False
            return
        self._as_looked_at = False
        # Of each node at each tick: a tenth of a mocked flight's time, so nothing is made here.
        invalid, running = Status.INVALID, Status.RUNNING
        for memory in self._memories.values():
            node = memory.node
            status = node.status
            if status is not invalid:
                memory.status, memory.left, memory.message = status, False, node.feedback_message
            elif memory.status is running and not memory.left:
                memory.left, memory.message = True, node.feedback_message

    def _changed(self, node: Node, _previous: Status, status: Status) -> None:
        self._as_looked_at = False
        memory = self._memories.get(node)
        if memory is not None and status is not Status.INVALID:
            memory.status, memory.left, memory.message = status, False, node.feedback_message
        elif memory is not None and memory.status is Status.RUNNING:
            memory.left, memory.message = True, node.feedback_message

    def look(self) -> NodeView:
        """Return a view of the whole tree as it is now; the last one, itself, where nothing has changed since."""
        self.remember()
        last = self._memories[self._root].view
        if last is None or not self._as_looked_at:
            last = self._view(self._root)
            self._as_looked_at = True
        return last

    def _view(self, node: Behaviour) -> NodeView:
        memory = self._memories[node]
        status = INTERRUPTED if memory.left else memory.status.value
        children = tuple(self._view(child) for child in node.children)
        last = memory.view
        if last is None or last.status != status or last.message != memory.message or any(map(operator.is_not, last.children, children)):
            last = memory.view = NodeView(node.name, memory.kind, status, memory.message, memory.skill, children, memory.source)
        return last
