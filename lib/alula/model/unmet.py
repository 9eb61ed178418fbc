"""What is not as a skill needs it, as values: why an execution was refused, or ended by an invariant. Messages are made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from alula.model.condition_text import bare_text
from alula.model.conditions import Data, States, data_of, present, value_of
from alula.model.expressions import Expression, ResourceIs, atoms
from alula.model.model import Effect

START_EFFECT = "start effect"
"""The name of what is unmet where a start effect is no transition now."""


@dataclass(frozen=True)
class Unmet:
    """One thing that is not as the skill needs it.

    Attributes:
        name: of the precondition or invariant, else ``START_EFFECT``.
        condition: as in the model.
        reason: what is the case instead, in words, with the name.
        states: of each resource that the condition asks, the state that it is in.
        data: ``battery.level`` and its value, SI units, for each data that the condition asks; None for what has no fresh value.
    """

    name: str
    condition: str
    reason: str
    states: Mapping[str, str]
    data: Mapping[str, object]


def unmet_condition(name: str, condition: Expression, states: States, data: Data) -> Unmet:
    """Return a condition that does not hold."""
    reason = f"{name}: {present(condition, states, data) or 'it is never true'}"
    asked = {atom.resource: states[atom.resource] for atom in atoms(condition) if isinstance(atom, ResourceIs)}
    values = {".".join((atom.data, *atom.path)): value_of(atom, data) for atom in data_of(condition)}
    return Unmet(name, bare_text(condition), reason, asked, values)


def unmet_effect(effect: Effect, reason: str, states: States) -> Unmet:
    """Return a start effect that is no transition from these states; ``reason`` says why not."""
    changes = ", ".join(f"{assignment.resource} -> {assignment.target}" for assignment in effect.assignments)
    return Unmet(START_EFFECT, changes, reason, {one.resource: states[one.resource] for one in effect.assignments}, {})
