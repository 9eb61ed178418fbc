"""From models to text, in either notation: what is printed reads back as the same model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from alula.language.notation import Notation
from alula.language.printing.paper import PAPER
from alula.language.printing.rl import ROBOT_LANGUAGE
from alula.language.printing.text import Style, skillset_text
from alula.model.model import NO_EFFECT, Effect, Skillset


class NotInThisNotationError(ValueError):
    """The model holds something that no text can express (it was made by hand): it would not read back as it is."""


_STYLES: Mapping[Notation, Style] = {Notation.PAPER: PAPER, Notation.ROBOT_LANGUAGE: ROBOT_LANGUAGE}


def print_skillset(skillset: Skillset, notation: Notation = Notation.PAPER) -> str:
    """Return a file with this skillset alone; raise NotInThisNotationError naming what can't be written."""
    return print_file([skillset], notation)


def print_file(skillsets: Sequence[Skillset], notation: Notation, types: Iterable[str] = ()) -> str:
    """Return a file with these skillsets, and with those of the types outside of them that none of them has."""
    for skillset in skillsets:
        _refuse(skillset)
    style = _STYLES[notation]
    # The types of an only skillset may stand outside, which is where the authors' tools look for them: it gets them all back.
    move = style.types_outside and len(skillsets) == 1
    known = {name for skillset in skillsets for name in skillset.types}
    outside = [*(skillsets[0].types if move else ()), *(name for name in types if name not in known)]
    head = "".join(f"type {name}\n" for name in outside)
    texts = [skillset_text(skillset, style, with_types=not move) for skillset in skillsets]
    return "\n".join([head, *texts] if head else texts)


def _refuse(skillset: Skillset) -> None:
    """Raise for an effect that has a name and is not the skill's effect of that name."""
    for event in skillset.events:
        if event.effect.name:
            raise NotInThisNotationError(f"the effect of event {event.name} can't have a name")
    for skill in skillset.skills:
        defined: dict[str, Effect] = {}
        for effect in skill.effects:
            defined.setdefault(effect.name, effect)
        used = [skill.start, skill.interrupt.effect, *(i.effect for i in skill.invariants), *(r.effect for r in skill.results)]
        for effect in used:
            if effect.name and defined.get(effect.name) != effect:
                raise NotInThisNotationError(f"skill {skill.name} has no effect {effect.name} as it is used")
            if not effect.name and effect != NO_EFFECT and not effect.assignments:
                raise NotInThisNotationError(f"skill {skill.name} has an effect without name and changes")
