"""Small systems as tables, and what Storm says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from alula.odds.figures import Figures
from alula.odds.graph import explore
from alula.odds.process import quantify
from alula.odds.storm import Storm
from alula.odds.system import Kind, Outcome, Step

ACCOMPLISHED, GIVEN_UP = Outcome.ACCOMPLISHED, Outcome.GIVEN_UP


@dataclass(frozen=True)
class Table:
    """A system as a table; the words "accomplished", "degraded", "given_up" are ends."""

    table: Mapping[str, Sequence[Step[str]]]

    def initial(self) -> list[str]:
        return ["begin"]

    def steps(self, state: str) -> Sequence[Step[str]]:
        return self.table.get(state, ())

    def outcome(self, state: str) -> Outcome | None:
        return Outcome(state) if state in {outcome.value for outcome in Outcome} else None


def end(skill: str, result: str, target: str) -> Step[str]:
    return Step(Kind.END, skill, target, result)


def now(target: str, *uses: str) -> Step[str]:
    return Step(Kind.NOW, "tick", target, uses=uses)


def fault(name: str, target: str) -> Step[str]:
    return Step(Kind.FAULT, name, target)


def storm(table: Mapping[str, Sequence[Step[str]]], figures: Figures, *, exact: bool | None = None) -> Storm:
    return Storm(quantify(explore(Table(table)), figures), exact=exact)


def chances(asked: Storm, outcome: Outcome = ACCOMPLISHED) -> tuple[Fraction, Fraction]:
    low, high = (asked.chance([outcome], most=most).number for most in (False, True))
    assert low.exact
    assert high.exact
    return low.low, high.low
