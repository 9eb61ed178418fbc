"""Evaluate the model's conditions over resource states and data."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

from skill_language.model import And, Comparison, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, SkillRuns, atoms
from skill_language.units import UNIT_IN_SI
from skill_runtime.core.errors import DataMissingError, UnsupportedModelError

States = Mapping[str, str]
Data = Mapping[str, object]

_COMPARE: dict[Comparison, Callable[[Any, Any], Any]] = {
    Comparison.EQ: operator.eq,
    Comparison.NE: operator.ne,
    Comparison.LT: operator.lt,
    Comparison.LE: operator.le,
    Comparison.GT: operator.gt,
    Comparison.GE: operator.ge,
}


def holds(condition: Expression, states: States, data: Data) -> bool:
    """Tell whether a condition is true.

    Raises:
        DataMissingError: it is over a data without a fresh value (a negation of the unknown is unknown, too).
    """
    match condition:
        case ResourceIs(resource=resource, state=state, negated=negated):
            return (states[resource] == state) != negated
        case DataIs():
            return _data_holds(condition, data)
        case Constant(value=value):
            return value
        case Not(operand=operand):
            return not holds(operand, states, data)
        case And(operands=operands):
            return all(holds(operand, states, data) for operand in operands)
        case Or(operands=operands):
            return any(holds(operand, states, data) for operand in operands)
        case SkillRuns(skill=skill):
            raise UnsupportedModelError(f"{skill} running: that can be asked in properties only")
        case Implies(premise=premise, conclusion=conclusion):
            return not holds(premise, states, data) or holds(conclusion, states, data)


def _data_holds(atom: DataIs, data: Data) -> bool:
    if atom.data not in data:
        raise DataMissingError(f"{atom.data} has no fresh value")
    value = data[atom.data]
    for name in atom.path:
        value = getattr(value, name)
    wanted = atom.value
    if isinstance(wanted, float | int) and not isinstance(wanted, bool):
        wanted = wanted * in_si(atom)
    return bool(_COMPARE[atom.comparison](value, wanted))


def in_si(atom: DataIs) -> float:
    """Return by what to multiply the atom's number to have it in SI units.

    Raises:
        UnsupportedModelError: the unit is not known.
    """
    if atom.unit not in UNIT_IN_SI:
        raise UnsupportedModelError(f"{atom.data}: unknown unit {atom.unit!r}; known are {', '.join(u for u in UNIT_IN_SI if u)}")
    return UNIT_IN_SI[atom.unit]


def present(condition: Expression, states: States) -> str:
    """Say in which states the resources of a condition are: ``axes_authority is USED, flight_status is IN_AIR``."""
    resources = dict.fromkeys(atom.resource for atom in atoms(condition) if isinstance(atom, ResourceIs))
    return ", ".join(f"{resource} is {states[resource]}" for resource in resources)


def data_of(condition: Expression) -> list[DataIs]:
    """Return the atoms over data."""
    return [atom for atom in atoms(condition) if isinstance(atom, DataIs)]
