"""Nodes that tick all their children in each tick."""

from __future__ import annotations

from collections.abc import Sequence

from alula.trees.ends import ENDS, FAILS, NO_END, SKIPS, SUCCEEDS, Ends, Given, whole_number
from alula.trees.errors import TickError
from alula.trees.node import Control, NodeConfig
from alula.trees.ports import input_port
from alula.trees.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import Order, Ticking
from alula.trees.values import INT


class _AtOnce(Control):
    may_run = False
    remembers = ("_done", "_failed")

    def __init__(self, config: NodeConfig) -> None:
        super().__init__(config)
        self._done: set[int] = set()
        self._failed = 0

    def halt(self) -> None:
        """Begin with all children the next time."""
        self._forget()
        super().halt()

    def _forget(self) -> None:
        self._done.clear()
        self._failed = 0

    def _threshold(self, port: str, given: int, never: str) -> int:
        """Return a number of children."""
        count = len(self.children)
        threshold = threshold_of(given, count)
        if threshold > count:
            raise TickError(f"{self.place()}: {port} is {given} and it has {count} children: it can never {never}")
        return threshold


def threshold_of(number: int, children: int) -> int:
    """Return a number of children; one below zero counts from all of them, -1 for all."""
    return max(children + number + 1, 0) if number < 0 else number


class Parallel(_AtOnce):
    """Ticks all children until enough have succeeded or failed; halts the others then."""

    ticking = Ticking(Order.AT_ONCE, place="_done", succeeds_after="success_count", fails_after="failure_count")
    ports = (
        input_port("success_count", INT, "-1", "how many have to succeed; -1: all"),
        input_port("failure_count", INT, "1", "how many have to fail for it to fail"),
    )

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """Count those that may succeed, or fail."""
        successes, failures, count = whole_number(given, "success_count"), whole_number(given, "failure_count"), len(children)
        skipped = SKIPS if all(child & SKIPS for child in children) else NO_END
        if successes is None or failures is None:
            return ENDS | skipped
        enough, too_many = threshold_of(successes, count), threshold_of(failures, count)
        counted = SUCCEEDS | SKIPS if successes < 0 else SUCCEEDS
        succeeding = sum(bool(child & counted) for child in children)
        failing = sum(FAILURE in child for child in children)
        fails = failing >= too_many or count - failing < enough
        return (SUCCEEDS if succeeding >= enough else NO_END) | (FAILS if fails else NO_END) | skipped

    def update(self) -> Answer:
        """Tick those that have not ended."""
        successes, failures = self.number("success_count"), self.number("failure_count")
        enough, too_many = self._threshold("success_count", successes, "succeed"), self._threshold("failure_count", failures, "fail")
        lenient, count = successes < 0, len(self.children)
        self.become(RUNNING)
        skipped = 0
        for index, child in enumerate(self.children):
            if index not in self._done:
                answer = child.execute()
                if answer is SKIPPED:
                    skipped += 1
                elif answer is not RUNNING:
                    self._done.add(index)
                    self._failed += answer is FAILURE
            succeeded = len(self._done) - self._failed
            if succeeded >= enough or (lenient and succeeded + skipped >= enough):
                return self._end(SUCCESS)
            if count - self._failed < enough or self._failed == too_many:
                return self._end(FAILURE)
        return SKIPPED if skipped == count else RUNNING

    def _end(self, answer: Answer) -> Answer:
        self._forget()
        self.reset_children()
        return answer


class ParallelAll(_AtOnce):
    """Ticks all children until each has ended; fails when too many failed."""

    ticking = Ticking(Order.AT_ONCE, place="_done", fails_after="max_failures")
    ports = (input_port("max_failures", INT, "1", "how many have to fail for it to fail; -1: all"),)

    @classmethod
    def may_end(cls, given: Given, children: Sequence[Ends]) -> Ends:
        """Count those that may fail, and those that have to."""
        failures = whole_number(given, "max_failures")
        if not all(children):
            return NO_END
        skipped = SKIPS if all(child & SKIPS for child in children) else NO_END
        if failures is None:
            return ENDS | skipped
        too_many = threshold_of(failures, len(children))
        succeeds = sum(child == FAILS for child in children) < too_many
        fails = sum(FAILURE in child for child in children) >= too_many
        return (SUCCEEDS if succeeds else NO_END) | (FAILS if fails else NO_END) | skipped

    def update(self) -> Answer:
        """Tick those that have not ended."""
        too_many, count = self._threshold("max_failures", self.number("max_failures"), "fail"), len(self.children)
        self.become(RUNNING)
        skipped = 0
        for index, child in enumerate(self.children):
            if index in self._done:
                continue
            answer = child.execute()
            if answer is SKIPPED:
                skipped += 1
            elif answer is not RUNNING:
                self._done.add(index)
                self._failed += answer is FAILURE
        if skipped == count:
            return SKIPPED
        if skipped + len(self._done) < count:
            return RUNNING
        answer = FAILURE if self._failed >= too_many else SUCCESS
        self.reset_children()
        self._forget()
        return answer
