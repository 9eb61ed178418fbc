"""A tree that can be ticked: what the factory makes of files, and what the mission, the viewers and the drawings hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from alula.trees.blackboard import Blackboard
from alula.trees.errors import TreeError
from alula.trees.node import Node, Shared, Watcher
from alula.trees.reading import TreeFiles
from alula.trees.status import FAILURE, IDLE, SUCCESS, Answer


@dataclass
class Subtree:
    """One use of a tree: ``path`` is empty for the main one, else as ``fly/leg::7``; ``nodes`` in the order of the file."""

    tree_id: str
    path: str
    blackboard: Blackboard
    nodes: list[Node] = field(default_factory=list)


class Tree:
    """Nodes with their uids (from 1, in the order of the file, as BehaviorTree.CPP counts them), and the subtrees they stand in."""

    def __init__(self, root: Node, subtrees: list[Subtree], files: TreeFiles, shared: Shared) -> None:
        self.root = root
        self.subtrees = subtrees
        self.files = files
        self.answer: Answer = IDLE
        """Of the last tick; IDLE before the first, and after a halt."""
        self._shared = shared

    @property
    def nodes(self) -> list[Node]:
        """All nodes, by their uids."""
        return sorted((node for subtree in self.subtrees for node in subtree.nodes), key=lambda node: node.uid)

    @property
    def blackboard(self) -> Blackboard:
        """The blackboard of the main tree."""
        return self.subtrees[0].blackboard

    @property
    def woken(self) -> bool:
        """Return whether a node yielded in the last tick (`Node.give_way`) and wants the next one at once; a late tick costs time only."""
        return self._shared.woken

    def tick(self) -> Answer:
        """Tick once and return the root's answer: a root that has ended is idle afterwards, and begins anew with the next tick.

        Raises:
            TreeError: a node can't be ticked; the tree is to be halted.
        """
        self._shared.woken = False
        try:
            self.answer = self.root.execute()
        except RecursionError as error:
            raise TreeError("the tree is nested too deeply") from error
        if self.answer is SUCCESS or self.answer is FAILURE:
            self.root.become(IDLE)
        return self.answer

    def halt(self) -> None:
        """Halt what runs; the next tick begins anew."""
        self.root.stop()
        self.answer = IDLE

    def watch(self, watcher: Watcher) -> Callable[[], None]:
        """Call ``watcher`` at each change of a node's status; the return value unsubscribes."""
        self._shared.watchers.append(watcher)
        return lambda: self._shared.watchers.remove(watcher)
