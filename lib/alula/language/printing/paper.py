"""Skills and conditions in the paper's notation."""

from __future__ import annotations

from collections.abc import Iterator

from alula.language.printing.text import (
    Style,
    block,
    changes_text,
    comment_text,
    effect_text,
    hold_text,
    parameter_text,
    purpose_lines,
)
from alula.model.condition_text import AND, IMPLIES, NOT, OR, atom_text, bare_text
from alula.model.expressions import TRUE, And, Constant, DataIs, Expression, Implies, Not, Or, ResourceIs, atoms
from alula.model.model import NO_EFFECT, Effect, Interrupt, Progress, Result, ResultKind, Skill

_WORDS_OF_RESULTS = frozenset({"success", "failure", "apply", "post"})
"""A result of such a name is written with a colon, so that it is not taken for the word."""


def skill_lines(skill: Skill) -> Iterator[str]:
    """Yield the lines of a skill."""
    yield f"skill {skill.name} {{"
    yield from purpose_lines(skill, condition_text)
    if skill.progress:
        yield f"  {_progress(skill.progress)}"
    yield from block("parameter", (parameter_text(p) for p in skill.parameters))
    yield from block("input", (parameter_text(p) for p in skill.inputs))
    yield from block("output", (parameter_text(p) for p in skill.outputs))
    yield from block("effect", (effect_text(e) for e in skill.effects))
    start = [f"success {_reference(skill.start)}"] if skill.start != NO_EFFECT else []
    yield from block("precondition", [f"{p.name}: {condition_text(p.condition)}" for p in skill.preconditions] + start)
    lines = (f"{i.name}: {condition_text(i.condition)}{hold_text(i.hold)}{_violation(i.effect)}" for i in skill.invariants)
    yield from block("invariant", lines)
    if skill.interrupt != Interrupt():
        yield from block("interrupt", [_interrupt(skill.interrupt)])
    yield from block("result", (_result(r) for r in skill.results))
    yield "}"


def condition_text(condition: Expression) -> str:
    """Return a condition as it stands behind `name:`."""
    kinds = {type(atom) for atom in atoms(condition)} - {Constant}
    if kinds == {ResourceIs}:
        return f"resource = ({bare_text(condition)})"
    if kinds == {DataIs}:
        return f"data = ({bare_text(condition)})"
    return _mixed(condition, IMPLIES)


def _mixed(condition: Expression, tightness: int) -> str:
    """Return a condition about both: the largest part about one kind gets its own word."""
    match condition:
        case Not(operand=operand):
            return f"not {_part(operand, NOT)}"
        case And(operands=operands):
            level, text = AND, " and ".join(_part(operand, NOT) for operand in operands)
        case Or(operands=operands):
            level, text = OR, " or ".join(_part(operand, AND) for operand in operands)
        case Implies(premise=premise, conclusion=conclusion):
            level, text = IMPLIES, f"{_part(premise, OR)} => {_part(conclusion, IMPLIES)}"
        case _:
            return atom_text(condition)
    return f"({text})" if level < tightness else text


def _part(condition: Expression, tightness: int) -> str:
    kinds = {type(atom) for atom in atoms(condition)} - {Constant}
    return condition_text(condition) if len(kinds) == 1 else _mixed(condition, tightness)


def _progress(progress: Progress) -> str:
    parts = [f"progress = {progress.period_s!r}"]
    parts += [f"deadline = {progress.deadline_s!r}"] if progress.deadline_s is not None else []
    parts += [f"message {progress.message}"] if progress.message else []
    if not progress.outputs:
        return " ".join(parts)
    return "\n    ".join([f"{' '.join(parts)} message {{", *(f"  {parameter_text(p)}" for p in progress.outputs), "}"])


def _reference(effect: Effect) -> str:
    return effect.name or changes_text(effect)


def _violation(effect: Effect) -> str:
    return "" if effect == NO_EFFECT else f" violation = {_reference(effect)}"


def _interrupt(interrupt: Interrupt) -> str:
    parts = ["interrupting"] if interrupt.interrupting else []
    parts += [f"timeout = {interrupt.timeout_s!r}"] if interrupt.timeout_s is not None else []
    parts.append(_outcome(interrupt.effect, interrupt.postcondition))
    return " ".join(parts).strip()


def _outcome(effect: Effect, postcondition: Expression) -> str:
    parts = [] if effect == NO_EFFECT else [f"apply = {_reference(effect)}"]
    if postcondition != TRUE:
        parts.append(f"post {condition_text(postcondition)}")
    return " ".join(parts)


def _result(result: Result) -> str:
    kind = "" if result.kind is ResultKind.PLAIN else f"{result.kind.value} "
    outcome = _outcome(result.effect, result.postcondition)
    colon = ":" if outcome or result.name in _WORDS_OF_RESULTS else ""
    return f"{kind}{result.name}{colon}{' ' if outcome else ''}{outcome}{comment_text(result.comment)}"


PAPER = Style(skill_lines, condition_text, transitions_in_block=False, types_outside=False)
