"""Report on a robot from trees: the names that nodes have got, and the decisions that trees leave to a person."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from alula.adopt.missions import Missions
from alula.adopt.skillset import in_a_line
from alula.adopt.vocabulary import Vocabulary

SHOWN = 3
"""Names of one kind that are listed; of more, the number is given."""


def names_of_nodes(vocabulary: Vocabulary) -> Iterator[str]:
    """Yield the rows of a table: the name in the trees, the name in the robot, and renamed ports and remarks."""
    for one in vocabulary.skills.values():
        renamed = [f"`{port}` is `{name}`" for table in (one.inputs, one.outputs) for port, name in table.items() if port != name]
        yield _row(one.type.name, f"skill `{one.name}`", [*renamed, one.type.doc])
    for resource in vocabulary.resources.values():
        yield _row(resource.text, f"resource `{resource.name}`", [resource.type.doc])
    for stand_in in vocabulary.stand_ins.values():
        yield _row(stand_in.type.name, f"class `{stand_in.class_name}`", [stand_in.type.doc])


def decisions(vocabulary: Vocabulary, missions: Missions, *, missing: Iterable[str], unused: Iterable[str]) -> Iterator[str]:
    """Yield a sentence for each decision that trees leave to a person.

    ``missing`` are trees that are used and in no file, ``unused`` those that no main tree uses.
    """
    module = f"python/{vocabulary.robot}_trees.py"
    guessed = [one.name for one in vocabulary.types.values() if one.doc]
    told = {
        "not declared, so kind, ports and types are guessed from their uses: see to the model": guessed,
        f"nodes with children of a program's own: write what they do in `{module}`": [
            one.type.name for one in vocabulary.stand_ins.values()
        ],
        "conditions that ask about an entry: each is one resource, whatever that entry holds": [
            one.text for one in vocabulary.resources.values() if one.asks_entries
        ],
        "trees that are in no file, so they are skills: give their folder, too, if you have it": sorted(missing),
        "trees that no main tree uses, so they are left out: `--main ID` makes a robot of one": sorted(unused),
        "stands for what a program writes on the blackboard before a tree starts: write what it does": [
            f"worlds/{one.name}.yaml" for one in missions.all if one.given
        ],
    }
    for what, names in told.items():
        if names:
            yield f"{_some(names)}: {what}"


def _row(node: str, what: str, told: Iterable[str]) -> str:
    cells = [f"`{node}`", what, "; ".join(one for one in told if one)]
    return "| " + " | ".join(in_a_line(cell).replace("|", "\\|") for cell in cells) + " |"


def _some(names: Sequence[str]) -> str:
    shown = ", ".join(f"`{name}`" for name in names[:SHOWN])
    return f"{shown} and {len(names) - SHOWN} more" if len(names) > SHOWN else shown
