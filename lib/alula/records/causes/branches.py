"""A mission's tree in time: which branch a failure took down, and with which one the tree went on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from alula.records.causes.faults import EARLY_S

INVALID, FAILURE, AT_WORK = "INVALID", "FAILURE", frozenset({"RUNNING", "SUCCESS"})
SELECTOR = "selector"


@dataclass(eq=False)
class Node:
    """A node of a tree; ``changes``: its statuses, each with the moment from which on it had it, seconds of mission clock."""

    kind: str
    name: str
    skill: str
    parent: Node | None
    children: list[Node] = field(default_factory=list)
    changes: list[tuple[float, str]] = field(default_factory=list)

    def failed_s(self, from_s: float, to_s: float) -> float | None:
        """Return when it failed between two moments; of a tree that was seen only once, the first of them; None: it did not."""
        found = (t_s for t_s, status in self.changes if status == FAILURE and from_s - EARLY_S <= t_s <= to_s)
        seen_once = [status for _, status in self.changes] == [FAILURE]
        return next(found, from_s if seen_once else None)

    def first_s(self, statuses: frozenset[str]) -> float | None:
        """Return when it was first in one of these; None: never."""
        return next((t_s for t_s, status in self.changes if status in statuses), None)

    @property
    def ticked_s(self) -> float | None:
        """When it was first ticked; None: never."""
        return next((t_s for t_s, status in self.changes if status != INVALID), None)


class Trees:
    """The trees that a mission ticked, one after the other."""

    def __init__(self) -> None:
        self._trees: list[tuple[float, list[Node]]] = []

    def add(self, t_s: float, shape: Sequence[Sequence[object]]) -> None:
        """Take a tree of another shape: of each node, top to bottom, depth, kind, name and skill first."""
        nodes: list[Node] = []
        above: dict[int, Node] = {}
        for depth, kind, name, skill, *_ in shape:
            level = int(str(depth))
            node = Node(str(kind), str(name), str(skill), above.get(level - 1))
            if node.parent is not None:
                node.parent.children.append(node)
            above[level] = node
            nodes.append(node)
        self._trees.append((t_s, nodes))

    def change(self, t_s: float, changes: Sequence[Sequence[object]]) -> None:
        """Take what changed: the index of a node and its status."""
        nodes = self._trees[-1][1] if self._trees else []
        for index, status, *_ in changes:
            nodes[int(str(index))].changes.append((t_s, str(status)))

    def at(self, t_s: float) -> list[Node]:
        """Return the nodes of the tree that was ticked at a moment, the first tree before it."""
        before = [nodes for since_s, nodes in self._trees if since_s <= t_s]
        return before[-1] if before else self._trees[0][1] if self._trees else []


def failed_branch(trees: Trees, skill: str, end_s: float, until_s: float) -> Node | None:
    """Return the highest node that failed with a skill, ``skillset.skill``, that ended badly; None: none did."""
    leaves = (node for node in trees.at(until_s) if node.skill == skill)
    top = next((leaf for leaf in leaves if leaf.failed_s(end_s, until_s) is not None), None)
    while top is not None and top.parent is not None and top.parent.failed_s(end_s, until_s) is not None:
        top = top.parent
    return top


def next_branch(failed: Node, answered_by: str) -> Node | None:
    """Return the alternative with which the tree went on: that of this name, else the first that was at work or was tried; None: none."""
    parent = failed.parent
    if parent is None or parent.kind != SELECTOR:
        return None
    later = [node for node in parent.children[parent.children.index(failed) + 1 :] if node.ticked_s is not None]
    named = (node for node in later if node.name == answered_by)
    at_work = (node for node in later if node.first_s(AT_WORK) is not None)
    return next(named, next(at_work, next(iter(later), None)))
