"""Whether what is asked of one value is in units of one kind."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

from alula.language.check.references import error, last_word
from alula.language.errors import Diagnostic
from alula.model.expressions import DataIs, atoms
from alula.model.model import Skillset
from alula.model.span import Span
from alula.model.units import KIND_OF_UNIT

Value = tuple[str, ...]
"""A data and a path of fields."""


def unit_kinds(skillset: Skillset) -> Iterator[Diagnostic]:
    """Yield a finding for each unit that measures something else than the value's own, or than the first unit that it is asked in."""
    known: dict[Value, tuple[str, Span]] = {(data.name,): (data.unit, data.span) for data in skillset.data if data.unit in KIND_OF_UNIT}
    for value, unit, place in sorted(_asked(skillset), key=lambda asked: (asked[2].line, asked[2].column)):
        first, where = known.setdefault(value, (unit, place))
        if KIND_OF_UNIT[unit] != KIND_OF_UNIT[first]:
            message = f"`{'.'.join(value)}` is compared in `{unit}`, {KIND_OF_UNIT[unit]}, but is in `{first}`, {KIND_OF_UNIT[first]}"
            yield error("ALU225", message, place, hint=f"line {where.line} says so")


def _asked(skillset: Skillset) -> Iterator[tuple[Value, str, Span]]:
    """Yield each value that is compared with a number in a known unit, the unit and its place."""
    skills = skillset.skills
    conditions = [one.condition for skill in skills for one in skill.preconditions]
    conditions += [one.condition for skill in skills for one in skill.invariants]
    for atom in chain.from_iterable(atoms(condition) for condition in conditions):
        if isinstance(atom, DataIs) and atom.unit in KIND_OF_UNIT:
            yield (atom.data, *atom.path), atom.unit, last_word(atom.span, atom.unit)
    for invariant in chain.from_iterable(skill.invariants for skill in skills):
        hold, condition = invariant.hold, invariant.condition
        if hold is not None and hold.unit in KIND_OF_UNIT and isinstance(condition, DataIs):
            yield (condition.data, *condition.path), hold.unit, last_word(hold.span, hold.unit)
