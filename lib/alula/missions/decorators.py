"""Decorators that py_trees has not, or has on the wall clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from alula.missions.blackboard import Blackboard


class Until(Decorator):  # type: ignore[misc]  # py_trees is seen untyped
    """Runs its child again and again until the condition holds after a success; fails with its child."""

    def __init__(self, name: str, child: Behaviour, condition: Callable[[], bool]) -> None:
        super().__init__(name=name, child=child)
        self._condition = condition

    def update(self) -> Status:
        """Return the child's status; where it succeeds, RUNNING until the condition holds."""
        if self.decorated.status is not Status.SUCCESS:
            return Status(self.decorated.status)
        return Status.SUCCESS if self._condition() else Status.RUNNING


class RetryAfter(Decorator):  # type: ignore[misc]  # py_trees is seen untyped
    """Gives its child another chance, ``wait_s`` of mission clock after a failure that is ``worth_it``, ``chances`` in all."""

    def __init__(
        self,
        name: str,
        child: Behaviour,
        *,
        chances: int,
        wait_s: float,
        worth_it: Callable[[], bool],
        blackboard: Blackboard,
    ) -> None:
        super().__init__(name=name, child=child)
        self._chances = chances
        self._wait_s = wait_s
        self._worth_it = worth_it
        self._blackboard = blackboard
        self._left = chances
        self._again_at_s = 0.0

    def initialise(self) -> None:
        """Begin with the first chance."""
        self._left = self._chances
        self._again_at_s = self._blackboard.now_s
        self.feedback_message = ""

    def tick(self) -> Iterator[Behaviour]:
        """Leave the child alone while it waits for its next chance: py_trees would start it before it asks `update`."""
        if self.status is Status.RUNNING and self._blackboard.now_s < self._again_at_s:
            yield self
        else:
            yield from super().tick()

    def update(self) -> Status:
        """Follow the child, or decide that it has another chance."""
        if self.decorated.status is not Status.FAILURE:
            return Status(self.decorated.status)
        self._left -= 1
        if not self._left or not self._worth_it():
            return Status.FAILURE
        self._again_at_s = self._blackboard.now_s + self._wait_s
        self.feedback_message = f"tries again after {self._wait_s:g} s"
        return Status.RUNNING
