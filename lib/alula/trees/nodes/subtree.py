"""The place where another tree of the files stands in."""

from __future__ import annotations

from alula.trees.node import Decorator
from alula.trees.node_type import Category
from alula.trees.status import FAILURE, IDLE, RUNNING, SUCCESS, Answer
from alula.trees.ticking import Order, Ticking


class SubTree(Decorator):
    """Another tree of the files."""

    category = Category.SUBTREE
    may_run = False
    ticking = Ticking(Order.SINGLE)

    def update(self) -> Answer:
        """Tick it."""
        if self.status is IDLE:
            self.become(RUNNING)
        answer = self.child.execute()
        if answer is SUCCESS or answer is FAILURE:
            self.reset_children()
        return answer
