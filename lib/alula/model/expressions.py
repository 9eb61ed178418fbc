"""Expressions: what conditions say, as plain values.

Conditions are over resource states (`axes == USED`), in preconditions and invariants over data (`battery.level > 0.2`),
and in properties over executions (`takeoff running`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum

from alula.model.span import NOWHERE, Span


class Comparison(Enum):
    """How the two sides of an atom are compared."""

    EQ = "=="
    NE = "!="
    LT = "<"
    LE = "<="
    GT = ">"
    GE = ">="


@dataclass(frozen=True)
class ResourceIs:
    """``resource == STATE`` or ``resource != STATE``."""

    resource: str
    state: str
    negated: bool = False
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class DataIs:
    """``data.field < number [unit]``; ``path`` is empty for a plain value."""

    data: str
    path: tuple[str, ...]
    comparison: Comparison
    value: float | str | bool
    unit: str = ""
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Constant:
    """The literals ``true`` and ``false``."""

    value: bool
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class SkillRuns:
    """``skill running``: an execution of the skill is running (Figure 5: RUNNING). Only properties ask it."""

    skill: str
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class MissionIs:
    """``active('node')``, ``outcome given_up`` or ``fault zed``: ``what`` is the word. Only properties of missions ask it."""

    what: str
    name: str
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Not:
    """``not operand``."""

    operand: Expression
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class And:
    """Conjunction of two or more operands."""

    operands: tuple[Expression, ...]
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Or:
    """Disjunction of two or more operands."""

    operands: tuple[Expression, ...]
    span: Span = field(default=NOWHERE, compare=False)


@dataclass(frozen=True)
class Implies:
    """``premise => conclusion``: false only where the premise holds and the conclusion does not."""

    premise: Expression
    conclusion: Expression
    span: Span = field(default=NOWHERE, compare=False)


Atom = ResourceIs | DataIs | SkillRuns | MissionIs | Constant
Expression = Atom | Not | And | Or | Implies
TRUE = Constant(value=True)


def atoms(expression: Expression) -> Iterator[Atom]:
    """Yield the leaves of an expression from left to right."""
    match expression:
        case Not(operand=operand):
            yield from atoms(operand)
        case And(operands=operands) | Or(operands=operands):
            for operand in operands:
                yield from atoms(operand)
        case Implies(premise=premise, conclusion=conclusion):
            yield from atoms(premise)
            yield from atoms(conclusion)
        case _:
            yield expression
