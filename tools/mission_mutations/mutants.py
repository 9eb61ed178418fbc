"""The altered missions and models of a robot, and which of them are looked at."""

from __future__ import annotations

import random
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.model.model import Skillset
from mission_mutations import models, trees

KINDS = (
    trees.FALLBACK_REMOVED,
    trees.CHILDREN_SWAPPED,
    trees.POLICY_CHANGED,
    trees.RETRY_DROPPED,
    models.INVARIANT_WEAKENED,
    models.EFFECT_FORGOTTEN,
    trees.RESULT_UNHANDLED,
    trees.CONDITION_NEGATED,
)


@dataclass(frozen=True)
class Mutant:
    """A mission with one alteration: in ``file``, whose text is ``text``, or in ``skillset``."""

    mission: str
    kind: str
    what: str
    file: str = ""
    text: str = ""
    skillset: Skillset | None = None


def mutants_of(
    mission: Path, files: Sequence[Path], skillsets: Sequence[Skillset], used: Mapping[str, Collection[str]]
) -> Iterator[Mutant]:
    """Yield all of a mission: in its files, and in the skills of each skillset that it uses."""
    for file in files:
        for kind, what, text in trees.altered(file.read_text(encoding="utf-8")):
            yield Mutant(mission.stem, kind, f"{file.name}, {what}", file.name, text)
    for skillset in skillsets:
        for kind, what, mutant in models.altered(skillset, used.get(skillset.name, ())):
            yield Mutant(mission.stem, kind, what, skillset=mutant)


def chosen(all_of_them: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """Return so many, as evenly of all kinds as there are, by chance."""
    chance = random.Random(seed)  # noqa: S311 - nothing here is secret
    by_kind = {kind: [one for one in all_of_them if one.kind == kind] for kind in KINDS}
    for known in by_kind.values():
        chance.shuffle(known)
    found: list[Mutant] = []
    while len(found) < count and any(by_kind.values()):
        found += [known.pop() for known in by_kind.values() if known]
    return found[:count]
