"""The tree as it is and as it went: for the console (JSON) and for the report (SVG)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.decorators import Decorator

from skill_missions.leaves import Check, SkillLeaf, Stays

INTERRUPTED = "INTERRUPTED"
KINDS: tuple[tuple[type[Behaviour], str], ...] = (
    (SkillLeaf, "skill"),
    (Sequence, "sequence"),
    (Selector, "selector"),
    (Parallel, "parallel"),
    (Decorator, "decorator"),
    (Check, "condition"),
    (Stays, "condition"),
)


@dataclass(frozen=True)
class NodeView:
    """A node at one moment; ``status`` is the last one that said something: a node that is left keeps it."""

    name: str
    kind: str
    status: str
    message: str
    skill: str
    children: tuple[NodeView, ...]

    def as_dict(self) -> dict[str, object]:
        """Return what is written as JSON."""
        return {
            "name": self.name,
            "kind": self.kind,
            "status": self.status,
            "message": self.message,
            "skill": self.skill,
            "children": [child.as_dict() for child in self.children],
        }

    def walk(self) -> Iterator[NodeView]:
        """Yield this node and all below, top to bottom."""
        yield self
        for child in self.children:
            yield from child.walk()


def kind_of(node: Behaviour) -> str:
    """Return what a node is, in the words of the figures."""
    return next((kind for cls, kind in KINDS if isinstance(node, cls)), "action")


class TreeWatch:
    """Remembers what each node last was: py_trees forgets it when it leaves a branch. To be asked after each tick."""

    def __init__(self, root: Behaviour) -> None:
        self._root = root
        self._last: dict[Behaviour, tuple[str, str]] = {}

    def look(self) -> NodeView:
        """Return the tree now."""
        return self._view(self._root)

    def _view(self, node: Behaviour) -> NodeView:
        status, message = self._remember(node)
        skill = node.skill_name if isinstance(node, SkillLeaf) else ""
        return NodeView(node.name, kind_of(node), status, message, skill, tuple(self._view(child) for child in node.children))

    def _remember(self, node: Behaviour) -> tuple[str, str]:
        before = self._last.get(node, (Status.INVALID.value, ""))
        if node.status is not Status.INVALID:
            self._last[node] = (node.status.value, node.feedback_message)
        elif before[0] == Status.RUNNING.value:
            self._last[node] = (INTERRUPTED, node.feedback_message)
        return self._last.get(node, before)
