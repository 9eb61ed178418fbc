"""Whether a skill could start, as far as its client can tell: from the model, the resources' states and the data's values."""

from __future__ import annotations

from collections.abc import Iterator

from skill_language.model import Skill, Skillset
from skill_language.printing.text import bare_text
from skill_runtime.core.conditions import Data, States, holds, present
from skill_runtime.core.effects import effect_changes
from skill_runtime.core.errors import DataMissingError, EffectError
from skill_runtime.core.semantics import Running
from skill_runtime.views import Unmet, Why


def readiness(skillset: Skillset, skill_name: str, states: States, data: Data) -> Why:
    """Return whether a skill could start, with every precondition that is not met; raise KeyError when there is no such skill.

    The skill's ``validate`` hook is not asked. ``data`` has the fresh values by name.
    """
    skill = skillset.skill(skill_name)
    unmet = tuple(_preconditions(skill, states, data)) or tuple(_start_effect(skillset, skill, states))
    return Why(skill_name, ready=not unmet, reason="; ".join(f"{one.name}: {one.reason}" for one in unmet), unmet=unmet)


def _preconditions(skill: Skill, states: States, data: Data) -> Iterator[Unmet]:
    for precondition in skill.preconditions:
        try:
            if holds(precondition.condition, states, data):
                continue
            reason = present(precondition.condition, states, data) or "the data does not meet it"
        except DataMissingError as error:
            reason = str(error)
        yield Unmet(precondition.name, bare_text(precondition.condition), reason)


def _start_effect(skillset: Skillset, skill: Skill, states: States) -> Iterator[Unmet]:
    try:
        effect_changes(skillset, Running("", skill.name), skill.start, "start", states)
    except EffectError as error:
        yield Unmet("start effect", skill.start.name, str(error))
