"""Conditions as text, as both notations and all messages write them."""

from __future__ import annotations

from alula.model.expressions import And, Atom, Constant, DataIs, Expression, Implies, MissionIs, Not, Or, ResourceIs, SkillRuns

IMPLIES, OR, AND, NOT = range(4)
"""How tightly an operator binds."""


def bare_text(condition: Expression, tightness: int = IMPLIES) -> str:
    """Return a condition without words around it, in parentheses where an operator as tight as ``tightness`` would tear it apart."""
    match condition:
        case Not(operand=operand):
            return f"not {bare_text(operand, NOT)}"
        case And(operands=operands):
            level, text = AND, " and ".join(bare_text(operand, NOT) for operand in operands)
        case Or(operands=operands):
            level, text = OR, " or ".join(bare_text(operand, AND) for operand in operands)
        case Implies(premise=premise, conclusion=conclusion):
            level, text = IMPLIES, f"{bare_text(premise, OR)} => {bare_text(conclusion, IMPLIES)}"
        case _:
            return atom_text(condition)
    return f"({text})" if level < tightness else text


def atom_text(atom: Atom) -> str:
    """Return a leaf of a condition."""
    match atom:
        case ResourceIs():
            return f"{atom.resource} {'!=' if atom.negated else '=='} {atom.state}"
        case SkillRuns():
            return f"{atom.skill} running"
        case MissionIs():
            return f"active('{atom.name}')" if atom.what == "active" else f"{atom.what} {atom.name}"
        case Constant():
            return "true" if atom.value else "false"
        case DataIs():
            unit = f" {atom.unit}" if atom.unit else ""
            return f"{'.'.join((atom.data, *atom.path))} {atom.comparison.value} {_value(atom.value)}{unit}"


def _value(value: float | str | bool) -> str:  # noqa: FBT001 - the value of a condition, not a switch
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return quote(value)
        case _:
            return repr(float(value))


def quote(value: str) -> str:
    """Return the STRING token of a value (the inverse of the lexer's ``string_value``)."""
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
