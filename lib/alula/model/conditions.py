"""Evaluate the model's conditions over resource states and data."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from alula.model.errors import DataMissingError, UnsupportedModelError
from alula.model.expressions import And, Comparison, Constant, DataIs, Expression, Implies, MissionIs, Not, Or, ResourceIs, SkillRuns, atoms
from alula.model.units import UNIT_IN_SI

States = Mapping[str, str]
Data = Mapping[str, object]
NO_DATA: Data = {}

_COMPARE: dict[Comparison, Callable[[Any, Any], Any]] = {
    Comparison.EQ: operator.eq,
    Comparison.NE: operator.ne,
    Comparison.LT: operator.lt,
    Comparison.LE: operator.le,
    Comparison.GT: operator.gt,
    Comparison.GE: operator.ge,
}


def judge(condition: Expression, states: States, data: Data) -> bool | None:
    """Return whether a condition is true (Kleene's logic); None where it depends on stale data, or on a resource not given."""
    match condition:
        case ResourceIs(resource=resource, state=state, negated=negated):
            known = states.get(resource)
            return None if known is None else (known == state) != negated
        case DataIs():
            return _data_holds(condition, data)
        case Constant(value=value):
            return value
        case Not(operand=operand):
            return _negated(judge(operand, states, data))
        case And(operands=operands):
            return _first(False, operands, states, data)
        case Or(operands=operands):
            return _first(True, operands, states, data)
        case SkillRuns(skill=skill):
            raise UnsupportedModelError(f"{skill} running: that can be asked in properties only")
        case MissionIs(what=what):
            raise UnsupportedModelError(f"{what}: that can be asked in properties of missions only")
        case Implies(premise=premise, conclusion=conclusion):
            return _first(True, (Not(premise), conclusion), states, data)


def holds(condition: Expression, states: States, data: Data) -> bool:
    """Return whether a condition is true.

    Raises:
        DataMissingError: that hangs on data without a fresh value (a negation of the unknown is unknown, too).
    """
    answer = judge(condition, states, data)
    if answer is None:
        unknown = next(atom for atom in data_of(condition) if _data_holds(atom, data) is None)
        raise DataMissingError(_why_unknown(unknown, data))
    return answer


def _negated(answer: bool | None) -> bool | None:  # noqa: FBT001 - a truth value is what it is about
    return None if answer is None else not answer


def _first(decisive: bool, operands: Sequence[Expression], states: States, data: Data) -> bool | None:  # noqa: FBT001 - as above
    """Return ``decisive`` if an operand is that, None if one may be, else its contrary."""
    answer: bool | None = not decisive
    for operand in operands:
        one = judge(operand, states, data)
        if one is decisive:
            return decisive
        if one is None:
            answer = None
    return answer


def _data_holds(atom: DataIs, data: Data) -> bool | None:
    value = value_of(atom, data)
    if value is None:
        return None
    wanted = atom.value
    if isinstance(wanted, float | int) and not isinstance(wanted, bool):
        wanted = wanted * in_si(atom)
    try:
        return bool(_COMPARE[atom.comparison](value, wanted))
    except TypeError:
        return None


def value_of(atom: DataIs, data: Data) -> object | None:
    """Return the value that an atom is about; None when there is none, or it is not a number where one was measured (NaN)."""
    return value_in(data.get(atom.data), atom.path)


def value_in(value: object, path: Sequence[str]) -> object | None:
    """Return the value of a field; None when there is none, or it is not a number where one was measured (NaN)."""
    for name in path:
        value = getattr(value, name, None)
    return None if isinstance(value, float) and math.isnan(value) else value


def _why_unknown(atom: DataIs, data: Data) -> str:
    name = ".".join((atom.data, *atom.path))
    if atom.data not in data:
        return f"{atom.data} has no fresh value"
    if value_of(atom, data) is None:
        return f"{name} is not in what was received, or not a number"
    return f"{name} is {value_of(atom, data)!r}, which can't be compared with {atom.value!r}"


def in_si(atom: DataIs) -> float:
    """Return by what to multiply the atom's number to have it in SI units.

    Raises:
        UnsupportedModelError: the unit is not known.
    """
    if atom.unit not in UNIT_IN_SI:
        raise UnsupportedModelError(f"{atom.data}: unknown unit {atom.unit!r}; known are {', '.join(u for u in UNIT_IN_SI if u)}")
    return UNIT_IN_SI[atom.unit]


def present(condition: Expression, states: States, data: Data) -> str:
    """Return what a condition asks about, as it is: ``axes_authority is USED, battery.level is 0.15, fps has no fresh value``."""
    resources = dict.fromkeys(atom.resource for atom in atoms(condition) if isinstance(atom, ResourceIs))
    words = [f"{resource} is {states[resource]}" for resource in resources]
    for atom in data_of(condition):
        known = _data_holds(atom, data) is not None
        words.append(f"{'.'.join((atom.data, *atom.path))} is {value_of(atom, data)}" if known else _why_unknown(atom, data))
    return ", ".join(dict.fromkeys(words))


def whatever_the_data(condition: Expression, *, unknown: bool) -> Expression:
    """Return over resources alone when a condition is true with all data unknown, the unknown being counted as ``unknown``."""
    match condition:
        case DataIs():
            return Constant(unknown)
        case Not(operand=operand):
            return Not(whatever_the_data(operand, unknown=not unknown))
        case And(operands=operands):
            return And(tuple(whatever_the_data(operand, unknown=unknown) for operand in operands))
        case Or(operands=operands):
            return Or(tuple(whatever_the_data(operand, unknown=unknown) for operand in operands))
        case Implies(premise=premise, conclusion=conclusion):
            return Implies(whatever_the_data(premise, unknown=not unknown), whatever_the_data(conclusion, unknown=unknown))
        case _:
            return condition


def data_of(condition: Expression) -> list[DataIs]:
    """Return the atoms over data."""
    return [atom for atom in atoms(condition) if isinstance(atom, DataIs)]
