"""Answer what one tick of a tree asks of its surroundings: observations, which a situation decides, and choices, which are free."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

from alula.common.errors import AlulaError

Question = tuple[Hashable, ...]
Answer = Hashable
View = Callable[[Question], Answer]
"""Answers the observations of a tick."""


class UndecidedError(AlulaError):
    """A node needs a value that the search does not know; the message names it."""


@dataclass(frozen=True)
class Asked:
    """A question of a tick with its answer; ``options`` are empty for an observation."""

    question: Question
    options: tuple[Answer, ...]
    answer: Answer


def sees_nothing(question: Question) -> Answer:
    """Answer no question: outside of a tick there is no observation."""
    raise UndecidedError(f"{question} is asked outside of a tick")


class Oracle:
    """Answers the questions of one tick: by what was answered before, then by the situation, and choices by their first option."""

    def __init__(self) -> None:
        self.asked: list[Asked] = []
        self._before: Sequence[Answer] = ()
        self._view: View = sees_nothing
        self._seen: dict[Question, Answer] = {}

    def begin(self, view: View, before: Sequence[Answer] = ()) -> None:
        """Begin a tick; ``before`` are the answers to its first questions."""
        self.asked = []
        self._before, self._view = before, view
        self._seen = {}

    def look(self, question: Question) -> Answer:
        """Return an observation; it stays the same for a whole tick."""
        if question in self._seen:
            return self._seen[question]
        number = len(self.asked)
        answer = self._before[number] if number < len(self._before) else self._view(question)
        self._seen[question] = answer
        self.asked.append(Asked(question, (), answer))
        return answer

    def choose(self, question: Question, options: tuple[Answer, ...] = (False, True)) -> Answer:
        """Return one of the options; replays of the tick get the others."""
        number = len(self.asked)
        answer = self._before[number] if number < len(self._before) else options[0]
        self.asked.append(Asked(question, options, answer))
        return answer
