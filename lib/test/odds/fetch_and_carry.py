"""Fetch and carry: drive to the pantry, pick a snack, drive to the table, place it; a new attempt goes on where the last one failed.

The task, its tree and its chances are those of a published tutorial for another model checker (AS2FM, ``tutorial_fetch_and_carry``):
driving succeeds with 0.7, picking with 0.6, placing always. Its sequence remembers the step that failed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from alula.odds.figures import Figures, SkillFigures, point
from alula.odds.system import Kind, Outcome, Step

LEGS = ("robot.drive", "robot.pick", "robot.drive", "robot.place")
CHANCES = {"robot.drive": Fraction(7, 10), "robot.pick": Fraction(6, 10), "robot.place": Fraction(1)}


class Place(NamedTuple):
    """Objects that are on the table, the step of the sequence, attempts that failed with this object; over: how it ended."""

    carried: int
    leg: int
    failed: int
    over: Outcome | None = None


@dataclass(frozen=True)
class FetchAndCarry:
    """One or several objects, each with so many attempts."""

    attempts: int = 1
    objects: int = 1

    def initial(self) -> list[Place]:
        return [Place(0, 0, 0)]

    def outcome(self, state: Place) -> Outcome | None:
        return state.over

    def steps(self, state: Place) -> Iterator[Step[Place]]:
        skill = LEGS[state.leg]
        yield Step(Kind.END, skill, self._done(state), "DONE")
        failed = state._replace(failed=state.failed + 1)
        yield Step(Kind.END, skill, failed if failed.failed < self.attempts else failed._replace(over=Outcome.GIVEN_UP), "FAILED")

    def _done(self, state: Place) -> Place:
        if state.leg + 1 < len(LEGS):
            return state._replace(leg=state.leg + 1)
        carried = state.carried + 1
        return Place(carried, 0, 0, Outcome.ACCOMPLISHED if carried == self.objects else None)


def figures() -> Figures:
    """Return the tutorial's chances, and times: it has none of its own."""
    skills = {name: SkillFigures(results={"DONE": point(chance)}, lasts=point(10)) for name, chance in CHANCES.items()}
    return Figures(skills=skills)


def by_hand(attempts: int) -> Fraction:
    """Return the chance of one object with so many attempts.

    It succeeds if driving, picking and driving fail less than ``attempts`` times together: n and m of the two drives' failures are
    n + m in (n + m + 1) orders. So the chance is 0.7 * 0.6 * 0.7 times the sum of (d + 1) * 0.3 ** d * 0.4 ** p over d + p < attempts.
    """
    drive, pick = CHANCES["robot.drive"], CHANCES["robot.pick"]
    failures = [(drives, picks) for drives in range(attempts) for picks in range(attempts - drives)]
    return drive * pick * drive * sum(((d + 1) * (1 - drive) ** d * (1 - pick) ** p for d, p in failures), Fraction(0))
