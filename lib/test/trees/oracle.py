"""Ticks a file with BehaviorTree.CPP itself and with ours, with leaves whose answers are given, and writes down what happens."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import behaviortreepy
from oracle_leaves import Act, Answers, Ask, Story, tell

from alula.trees.errors import TreeError
from alula.trees.factory import make_tree
from alula.trees.nodes import entries
from alula.trees.reading import read_text
from alula.trees.registry import NodeRegistry
from alula.trees.standard import standard_registry
from alula.trees.status import NAMES

RAISED = "raised"
_kept: deque[object] = deque(maxlen=50)
"""Trees are kept for a while. As one goes, BehaviorTree.CPP joins the threads of its timers, which can miss that they are to end
while they are about to wait, and the process hangs: by then they wait."""


class Leaves:
    """What the leaves do. A factory keeps this for good, so it must not know of factory or trees: the trees' threads would never end."""

    def __init__(self) -> None:
        self.story = Story({})
        self._status = behaviortreepy.NodeStatus.__members__

    def start(self, node):
        return self._status[self.story.answer("start", node.full_path(), node.name())]

    def tick(self, node):
        return self._status[self.story.answer("tick", node.full_path(), node.name())]

    def halted(self, node) -> None:
        self.story.halted(node.full_path())


class Theirs:
    """BehaviorTree.CPP; one factory for many files, because making one is what takes most of the time."""

    def __init__(self) -> None:
        self._leaves = Leaves()
        self._factory = behaviortreepy.BehaviorTreeFactory()
        self._factory.register_simple_stateful_action("Act", self._leaves.start, self._leaves.tick, self._leaves.halted)
        self._factory.register_simple_condition("Ask", self._leaves.start)

    def play(self, text: str, answers: Answers, ticks: int, halts: Sequence[int]) -> Story:
        """Tick a file so often, halted before some of the ticks."""
        story = self._leaves.story = Story(answers)
        try:
            tree = self._factory.create_tree_from_text(text)
        except (RuntimeError, ValueError) as error:
            story.error = str(error)
            story.ticked(RAISED)
            return story
        for number in range(ticks):
            try:
                if number in halts:
                    tree.root_node().halt_node()
                root = tree.tick_exactly_once().name
            except (RuntimeError, ValueError) as error:
                story.error = str(error)
                story.ticked(RAISED)
                break
            story.ticked(root)
        story.entries = set(tree.root_blackboard().get_keys())
        self._leaves.story = Story(answers)  # what a tree does as it goes is nobody's
        _kept.append(tree)
        return story


class SkipUnlessUpdated(entries.SkipUnlessUpdated):
    """As of version 4.8: halted, it leaves its child running (docs/concepts/trees.md)."""

    def halt(self) -> None:
        self._running = False


class WaitValueUpdate(entries.WaitValueUpdate):
    """As of version 4.8: halted, it leaves its child running (docs/concepts/trees.md)."""

    def halt(self) -> None:
        self._running = False


AS_OF_4_8 = (SkipUnlessUpdated, WaitValueUpdate)
PALETTE = NodeRegistry(one for one in standard_registry() if one.name not in {node.__name__ for node in AS_OF_4_8})
for node in AS_OF_4_8:
    PALETTE.register(node)
PALETTE.register(Act)
PALETTE.register(Ask)


def ours(text: str, answers: Answers, ticks: int, halts: Sequence[int]) -> Story:
    """Tick a file with the trees of this library, as `Theirs.play` does."""
    story = Story(answers)
    tell(story)
    try:
        tree = make_tree(read_text(text), PALETTE, lambda: 0)
    except TreeError as error:
        story.error = str(error)
        story.ticked(RAISED)
        return story
    for number in range(ticks):
        try:
            if number in halts:
                tree.root.halt_node()
            root = NAMES[tree.tick()]
        except TreeError as error:
            story.error = str(error)
            story.ticked(RAISED)
            break
        story.ticked(root)
    return story
