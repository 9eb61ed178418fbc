"""Find values of data that make a step possible: the search knows that there are some, a counterexample has to name them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from alula.language.counterexamples import Path, Values
from alula.model.expressions import DataIs, Expression, Not, atoms
from alula.model.model import Invariant, Skillset
from alula.prove.limits import OutOfTimeError
from alula.prove.skillset.solver import Solver

States = Mapping[str, str]


@dataclass(frozen=True)
class Wish:
    """A condition that the data shall fulfil in these states of the resources."""

    condition: Expression
    states: States


class Witness:
    """Finds values for the wishes of a counterexample, one step after another; values stay until something else is wished."""

    def __init__(self, skillset: Skillset, solver: Solver) -> None:
        self._skillset = skillset
        self._solver = solver

    def values(self, wishes: Sequence[Wish]) -> Values | None:
        """Return values that fulfil all wishes, none where no data is asked, None where there are none or time is over."""
        asked = {path_of(atom) for wish in wishes for atom in data_atoms([wish.condition])}
        if not asked:
            return {}
        terms = [self._solver.term(wish.condition, wish.states) for wish in wishes]
        try:
            model = self._solver.example(*terms)
        except OutOfTimeError:
            return None
        return None if model is None else {path: value for path, value in self._solver.data_values(model).items() if path in asked}


def data_atoms(conditions: Iterable[Expression]) -> list[DataIs]:
    """Return the atoms of conditions that are about data."""
    return [atom for condition in conditions for atom in atoms(condition) if isinstance(atom, DataIs)]


def path_of(atom: DataIs) -> Path:
    """Return the data and field that an atom is about."""
    return (atom.data, *atom.path)


def fallen(invariant: Invariant) -> Expression | None:
    """Return the condition of a value that falls through the threshold of an invariant that must recover, None for others."""
    return Not(invariant.condition) if invariant.hold is not None and invariant.hold.hysteresis is not None else None
