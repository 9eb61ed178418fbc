"""Why a skill could not start now: every precondition that is not met, with what is the case instead."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from alula.model import semantics
from alula.model.condition_text import bare_text
from alula.model.conditions import Data, States, judge, present, value_of
from alula.model.effects import effect_changes
from alula.model.errors import EffectError
from alula.model.expressions import DataIs, Expression, ResourceIs, atoms
from alula.model.model import Skill, Skillset
from alula.model.situation import Entered, Running, Situation
from alula.runtime.core.events import TransitionEvent

START_EFFECT = "start effect"


@dataclass(frozen=True)
class Unmet:
    """One thing that is not as the skill needs it; ``data`` holds None for what has no fresh value."""

    name: str
    condition: str
    reason: str
    states: Mapping[str, str]
    data: Mapping[str, object]


@dataclass(frozen=True)
class Why:
    """Answer to: could this skill start now?

    ``reason`` is one sentence, empty when ready; ``refusal`` is what ``validate`` says, if it was asked; ``history`` the last
    transitions of the resources that the skill asks for or changes, the oldest first.
    """

    skill: str
    ready: bool
    reason: str
    refusal: str
    unmet: tuple[Unmet, ...]
    history: tuple[TransitionEvent, ...]


def unmet(skillset: Skillset, situation: Situation, skill: Skill) -> tuple[Unmet, ...]:
    """Return what keeps the skill from running if it were started now, in the model's order."""
    found = list(_preconditions(skill, situation))
    if found:
        return tuple(found)
    execution = Running("", skill.name)
    try:
        effect_changes(skillset, execution, skill.start, "start", situation.states)
    except EffectError as error:
        resources = [assignment.resource for assignment in skill.start.assignments]
        effect = ", ".join(f"{assignment.resource} -> {assignment.target}" for assignment in skill.start.assignments)
        return (Unmet(START_EFFECT, effect, str(error), {name: situation.states[name] for name in resources}, {}),)
    step = semantics.start(skillset, situation, execution)
    ends = (happening for happening in step.happenings if isinstance(happening, Entered) and happening.execution == execution)
    for end in ends:
        if end.state.terminal:  # its own invariant is false as soon as it has started
            invariant = next(i for i in skill.invariants if i.name == end.result)
            return (_unmet(end.result, invariant.condition, end.message, step.situation),)
    return ()


def resources_of(skill: Skill) -> tuple[str, ...]:
    """Return the resources that a skill's preconditions and invariants ask for or that its start changes."""
    conditions = [p.condition for p in skill.preconditions] + [i.condition for i in skill.invariants]
    asked = [atom.resource for condition in conditions for atom in atoms(condition) if isinstance(atom, ResourceIs)]
    return tuple(dict.fromkeys([*asked, *(assignment.resource for assignment in skill.start.assignments)]))


def sentence(found: tuple[Unmet, ...], refusal: str, closed: str) -> str:
    """Say in one sentence what keeps the skill from running; "" for nothing."""
    parts = [closed, refusal, *(one.reason for one in found)]
    return "; ".join(part for part in parts if part)


def _preconditions(skill: Skill, situation: Situation) -> Iterator[Unmet]:
    for precondition in skill.preconditions:
        condition = precondition.condition
        if judge(condition, situation.states, situation.data) is not True:
            reason = present(condition, situation.states, situation.data)
            yield _unmet(precondition.name, condition, f"{precondition.name}: {reason}", situation)


def _unmet(name: str, condition: Expression, reason: str, situation: Situation) -> Unmet:
    return Unmet(name, bare_text(condition), reason, _states(condition, situation.states), _values(condition, situation.data))


def _states(condition: Expression, states: States) -> dict[str, str]:
    return {atom.resource: states[atom.resource] for atom in atoms(condition) if isinstance(atom, ResourceIs)}


def _values(condition: Expression, data: Data) -> dict[str, object]:
    """Return ``battery.level`` and its value for each data that a condition asks, None where there is no fresh value."""
    asked = [atom for atom in atoms(condition) if isinstance(atom, DataIs)]
    return {".".join((atom.data, *atom.path)): value_of(atom, data) for atom in asked}
