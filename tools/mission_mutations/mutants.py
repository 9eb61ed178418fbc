"""The altered missions and models of a robot, and which of them are looked at."""

from __future__ import annotations

import random
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset
from alula.prove.mission.own import has_children
from alula.trees.node import name_in_files
from mission_mutations import classes, models, trees

KINDS = (
    trees.FALLBACK_REMOVED,
    trees.CHILDREN_SWAPPED,
    trees.POLICY_CHANGED,
    trees.RETRY_DROPPED,
    models.INVARIANT_WEAKENED,
    models.EFFECT_FORGOTTEN,
    trees.RESULT_UNHANDLED,
    trees.CONDITION_NEGATED,
    trees.OWN_DROPPED,
    classes.CLASS_ALTERED,
)


@dataclass(frozen=True)
class Mutant:
    """A mission with one alteration: in ``file``, whose text is ``text``, in ``skillset``, or in a class (``altered``)."""

    mission: str
    kind: str
    what: str
    file: str = ""
    text: str = ""
    skillset: Skillset | None = None
    altered: classes.Altered | None = None

    def part_of(self, part: MissionPart) -> MissionPart:
        """Return a robot's part with the altered class in it."""
        return part if self.altered is None else self.altered.within(part)


def mutants_of(
    mission: Path,
    files: Sequence[Path],
    skillsets: Sequence[Skillset],
    used: Mapping[str, Collection[str]],
    part: MissionPart = NO_PART,
) -> Iterator[Mutant]:
    """Yield all of a mission: in its files, in the skills of each skillset that it uses, and in the robot's own nodes with children."""
    texts = {file: file.read_text(encoding="utf-8") for file in files}
    own = {name_in_files(one): one for one in part.nodes if has_children(one.category, one.child_count)}
    for file, before in texts.items():
        for kind, what, text in trees.altered(before, own):
            yield Mutant(mission.stem, kind, f"{file.name}, {what}", file.name, text)
    for skillset in skillsets:
        for kind, what, mutant in models.altered(skillset, used.get(skillset.name, ())):
            yield Mutant(mission.stem, kind, what, skillset=mutant)
    for name, node in own.items():
        if any(f"<{name}" in text for text in texts.values()):
            for what, altered in classes.altered(node):
                yield Mutant(mission.stem, classes.CLASS_ALTERED, f"{name}: {what}", altered=altered)


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
