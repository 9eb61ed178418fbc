"""Leaves whose answers are given, and what happens to them."""

from __future__ import annotations

from dataclasses import dataclass, field

from alula.trees.node import Action, Condition
from alula.trees.status import ANSWERS, Answer

Answers = dict[str, list[str]]


@dataclass
class Story:
    """What happens tick by tick: the root's answer, and the starts, ticks and halts of the leaves, each with its path."""

    answers: Answers
    ticks: list[tuple[str, list[tuple[str, str]]]] = field(default_factory=list)
    calls: list[tuple[str, str]] = field(default_factory=list)
    error: str = ""
    entries: set[str] = field(default_factory=set)
    """Names on the root's blackboard in the end, of BehaviorTree.CPP."""
    _asked: dict[str, int] = field(default_factory=dict)

    def answer(self, call: str, path: str, name: str) -> str:
        self.calls.append((call, path))
        count = self._asked[path] = self._asked.get(path, -1) + 1
        given = self.answers[name]
        return given[count % len(given)]

    def halted(self, path: str) -> None:
        self.calls.append(("halt", path))

    def ticked(self, root: str) -> None:
        self.ticks.append((root, self.calls))
        self.calls = []


STORY: list[Story] = []


def tell(story: Story) -> None:
    """Have the leaves of all trees take part in this story from now on."""
    STORY[:] = [story]


class Act(Action):
    """A leaf whose answers are given."""

    def on_start(self) -> Answer:
        return ANSWERS[STORY[0].answer("start", self.config.path, self.name)]

    def on_running(self) -> Answer:
        return ANSWERS[STORY[0].answer("tick", self.config.path, self.name)]

    def on_halted(self) -> None:
        STORY[0].halted(self.config.path)


class Ask(Condition):
    """A condition whose answers are given."""

    def update(self) -> Answer:
        return ANSWERS[STORY[0].answer("start", self.config.path, self.name)]
