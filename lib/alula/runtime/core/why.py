"""Why a skill could not start now: every precondition that is not met, with what is the case instead."""

from __future__ import annotations

from dataclasses import dataclass

from alula.model import semantics
from alula.model.expressions import ResourceIs, atoms
from alula.model.model import Skill, Skillset
from alula.model.situation import Entered, Running, Situation
from alula.model.unmet import Unmet
from alula.runtime.core.events import TransitionEvent


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
    found = tuple(semantics.unmet_preconditions(skill, situation.states, situation.data))
    if found:
        return found
    execution = Running("", skill.name)
    step = semantics.start(skillset, situation, execution)
    entered = [happening for happening in step.happenings if isinstance(happening, Entered) and happening.execution == execution]
    return entered[-1].unmet  # its own invariant may be false as soon as it has started


def resources_of(skill: Skill) -> tuple[str, ...]:
    """Return the resources that a skill's preconditions and invariants ask for or that its start changes."""
    conditions = [p.condition for p in skill.preconditions] + [i.condition for i in skill.invariants]
    asked = [atom.resource for condition in conditions for atom in atoms(condition) if isinstance(atom, ResourceIs)]
    return tuple(dict.fromkeys([*asked, *(assignment.resource for assignment in skill.start.assignments)]))


def sentence(found: tuple[Unmet, ...], refusal: str, closed: str) -> str:
    """Return in one sentence what keeps the skill from running; "" for nothing."""
    parts = [closed, refusal, *(one.reason for one in found)]
    return "; ".join(part for part in parts if part)
