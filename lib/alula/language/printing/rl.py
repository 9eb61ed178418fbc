"""Skills and conditions in the Robot Language."""

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
from alula.model.condition_text import bare_text
from alula.model.expressions import TRUE, DataIs, Expression, atoms
from alula.model.model import NO_EFFECT, Effect, Interrupt, Invariant, Progress, Result, Skill


def skill_lines(skill: Skill) -> Iterator[str]:
    """Yield the lines of a skill."""
    yield f"skill {skill.name} {{"
    yield from purpose_lines(skill, condition_text)
    yield from block("parameter", (parameter_text(p) for p in skill.parameters))
    yield from block("input", (parameter_text(p) for p in skill.inputs))
    yield from block("output", (parameter_text(p) for p in skill.outputs))
    yield from block("effect", (effect_text(e) for e in skill.effects))
    yield from block("precondition", [f"{p.name}: {condition_text(p.condition)}" for p in skill.preconditions])
    if skill.start != NO_EFFECT:
        yield f"  start {_reference(skill.start)}"
    yield from block("invariant", (_invariant(i) for i in skill.invariants))
    if skill.progress:
        yield from block("progress", _progress(skill.progress))
    if skill.interrupt != Interrupt():
        yield from block("interrupt", _interrupt(skill.interrupt))
    yield from (f"  {result.kind.value} {_result(result)}" for result in skill.results)
    yield "}"


def condition_text(condition: Expression) -> str:
    """Return a condition; in parentheses where it has a unit, which a name behind it might be taken for otherwise."""
    text = bare_text(condition)
    return f"({text})" if any(isinstance(atom, DataIs) and atom.unit for atom in atoms(condition)) else text


def _reference(effect: Effect) -> str:
    return effect.name or changes_text(effect)


def _invariant(invariant: Invariant) -> str:
    effect = "" if invariant.effect == NO_EFFECT else f" effect {_reference(invariant.effect)}"
    return f"{invariant.name} {{ guard {condition_text(invariant.condition)}{hold_text(invariant.hold)}{effect} }}"


def _progress(progress: Progress) -> Iterator[str]:
    yield f"period {progress.period_s!r} s"
    if progress.deadline_s is not None:
        yield f"deadline {progress.deadline_s!r} s"
    if progress.message:
        yield f"message {progress.message}"
    yield from (f"message {parameter_text(output)}" for output in progress.outputs)


def _interrupt(interrupt: Interrupt) -> Iterator[str]:
    yield f"interrupting {'true' if interrupt.interrupting else 'false'}"
    if interrupt.timeout_s is not None:
        yield f"timeout {interrupt.timeout_s!r} s"
    yield from _outcome(interrupt.effect, interrupt.postcondition)


def _outcome(effect: Effect, postcondition: Expression) -> Iterator[str]:
    if effect != NO_EFFECT:
        yield f"effect {_reference(effect)}"
    if postcondition != TRUE:
        yield f"postcondition {condition_text(postcondition)}"


def _result(result: Result) -> str:
    body = " ".join(_outcome(result.effect, result.postcondition))
    return f"{result.name} {{ {body} }}{comment_text(result.comment)}" if body else f"{result.name} {{}}{comment_text(result.comment)}"


ROBOT_LANGUAGE = Style(skill_lines, condition_text, transitions_in_block=True, types_outside=True)
