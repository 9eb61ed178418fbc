"""Entries of the blackboards of trees: which types they have, which ports get theirs from them, and which of them a program writes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from alula.adopt.vocabulary import SkillOf, Vocabulary
from alula.check.entries import NUMBER, TEXT, Use, Uses
from alula.check.scripts import Scripts
from alula.check.sites import Key, Site, expand
from alula.check.traits import PlainTraits
from alula.missions.skill_types import PORT_TYPES, STATE_PORT
from alula.trees.node import pointer
from alula.trees.palette import Category, Direction, NodeType, Palette, Port, node_type
from alula.trees.reading import TreeFiles
from alula.trees.values import ANY, DOUBLE, NUMBERS, STRING, TYPES, PortType, literal

Slot = tuple[str, str]
"""A skill's input or output: the names of both."""
MODEL_TYPES = {kind: name for name, kind in PORT_TYPES.items() if name != "float32"}
"""Types of the models for types of ports."""
ZEROS = {"bool": "false", "string": "", "float64": "0.0"}
"""How a value that nobody gives is written, by type of the models; of whole numbers 0."""


def model_type(kind: PortType) -> str:
    """Return the type of the models for one of ports: a text for all that BehaviorTree.CPP reads from text in a program's own way."""
    return MODEL_TYPES.get(kind, "string")


def zero(kind: str) -> str:
    """Return the value that stands for one that nobody gives, as text."""
    return ZEROS.get(kind, "0")


@dataclass(frozen=True)
class GivenEntry:
    """An entry that a main tree reads before it writes it, so that a program has to; ``value`` stands for what that gives."""

    name: str
    value: object
    line: int
    """Where it is read first."""


class Entries:
    """What main trees, whose nodes are a robot's already, say about entries."""

    def __init__(self, mains: Sequence[TreeFiles], vocabulary: Vocabulary, known: Palette) -> None:
        self._skills = {f"{vocabulary.robot}.{one.name}": one for one in vocabulary.skills.values()}
        self._types: dict[Slot, PortType] = dict(_declared(vocabulary))
        self._palette = known | Palette(_types(vocabulary))
        self._uses: list[tuple[TreeFiles, list[tuple[Site, Use]]]] = [(files, self._of(files)) for files in mains]
        self._refuse_literals()
        self._spread()

    def type(self, skill: str, name: str) -> str:
        """Return the type of an input or output, as models have it."""
        return model_type(self._types[skill, name])

    def zeros(self) -> Mapping[Slot, str]:
        """Return what stands for inputs that a use leaves out."""
        return {slot: zero(self.type(*slot)) for slot in self._types}

    def given(self, files: TreeFiles) -> list[GivenEntry]:
        """Return the entries that a program writes before it starts a main tree."""
        uses = next(uses for one, uses in self._uses if one is files)
        model = files.models.get(files.main)
        ports = model.ports if model is not None else {}
        told = {name: port.default for name, port in ports.items() if port.direction is not Direction.OUTPUT}
        first: dict[Key, Use] = {}
        for _, use in uses:
            first.setdefault(use.key, use)
        read = {name: use for (board, name), use in first.items() if board == 0 and not use.write}
        enums = 0
        found = []
        for name in sorted({*read, *told}):
            default = told.get(name)
            kind = self._kind([pair for pair in uses if pair[1].key == (0, name)])
            if default is not None and pointer(default, name) is None:
                value = literal(default)
            elif name.isupper() and name in read and read[name].offsets is not None:  # an enumerator of the program's
                enums += 1
                value = enums
            else:
                value = {"bool": False, "string": "", "float64": 0.0}.get(kind, 0)
            line = read[name].attribute.place.line if name in read else files.trees[files.main].place.line
            found.append(GivenEntry(name, value, line))
        return found

    def _of(self, files: TreeFiles) -> list[tuple[Site, Use]]:
        root = expand(files, self._palette, files.main)
        if root is None:
            return []
        uses = Uses(Scripts(), PlainTraits())
        sites = {id(use): site for site in root.walk() for use in (*uses.before(site), *uses.after(site))}
        return [(sites[id(use)], use) for use in uses.of(root)]

    def _slot(self, site: Site, port: str) -> Slot | None:
        skill = self._skills.get(site.kind)
        return (skill.name, port) if skill is not None and (skill.name, port) in self._types else None

    def _refuse_literals(self) -> None:
        """Have a port take texts where a use gives it one that its type can't be read from, such as an enumerator of a program's."""
        for files, _ in self._uses:
            for tree in files.trees.values():
                for node in tree.iterate():
                    skill = self._skills.get(node.get("ID") or node.tag) or self._skills.get(node.tag)
                    for attribute in node.attributes.values() if skill else ():
                        slot = (skill.name if skill else "", attribute.name)
                        if (
                            slot in self._types
                            and pointer(attribute.value, attribute.name) is None
                            and not _reads(self._types[slot], attribute.value)
                        ):
                            self._types[slot] = STRING

    def _spread(self) -> None:
        """Give what has no type yet that of the entries which it names, until nothing changes."""
        groups = [list(_by_key(uses).values()) for _, uses in self._uses]
        changed = True
        while changed:
            changed = False
            for pairs in (pairs for found in groups for pairs in found):
                kind = self._common(pairs)
                for site, use in pairs:
                    slot = self._slot(site, use.attribute.name)
                    if kind is not ANY and slot is not None and self._types[slot] is ANY:
                        self._types[slot], changed = kind, True

    def _common(self, pairs: Iterable[tuple[Site, Use]]) -> PortType:
        """Return the type that all who name an entry agree on: of several kinds of number the widest, else a text; ANY where nobody says.

        A number of a script is of any of these kinds.
        """
        told = [(self._told(site, use), use.type == NUMBER) for site, use in pairs]
        kinds = {kind for kind, is_of_script in told if kind is not ANY and not is_of_script}
        if not kinds:
            return DOUBLE if any(is_of_script for _, is_of_script in told) else ANY
        if len(kinds) == 1:
            return next(iter(kinds))
        return DOUBLE if kinds <= set(NUMBERS) else STRING

    def _told(self, site: Site, use: Use) -> PortType:
        slot = self._slot(site, use.attribute.name) if use.offsets is None else None
        if slot is not None:
            return self._types[slot]
        return STRING if use.type == TEXT else TYPES.get(use.type, ANY)

    def _kind(self, pairs: Sequence[tuple[Site, Use]]) -> str:
        kind = self._common(pairs)
        is_of_scripts = all(use.offsets is not None for _, use in pairs) and pairs
        return "float64" if kind is ANY and is_of_scripts else model_type(kind)


def _by_key(uses: Iterable[tuple[Site, Use]]) -> dict[Key, list[tuple[Site, Use]]]:
    found: dict[Key, list[tuple[Site, Use]]] = {}
    for site, use in uses:
        found.setdefault(use.key, []).append((site, use))
    return found


def _reads(kind: PortType, text: str) -> bool:
    try:
        kind.parse(text)
    except ValueError:
        return False
    return True


def _slots(skill: SkillOf) -> Iterable[tuple[str, Port, Direction]]:
    yield from ((name, skill.type.ports[port], Direction.INPUT) for port, name in skill.inputs.items())
    yield from ((name, skill.type.ports[port], Direction.OUTPUT) for port, name in skill.outputs.items())


def _declared(vocabulary: Vocabulary) -> Iterable[tuple[Slot, PortType]]:
    for skill in vocabulary.skills.values():
        yield from (((skill.name, name), port.type if port.type in MODEL_TYPES else ANY) for name, port, _ in _slots(skill))


def _types(vocabulary: Vocabulary) -> Iterable[NodeType]:
    """Yield the types of node that a robot has by a vocabulary; ports that nothing is known of take anything."""
    robot = vocabulary.robot
    for skill in vocabulary.skills.values():
        yield node_type(f"{robot}.{skill.name}", Category.ACTION, [Port(name, port.type, told) for name, port, told in _slots(skill)])
    for resource in vocabulary.resources.values():
        yield node_type(f"{robot}.{resource.name}", Category.CONDITION, [Port(STATE_PORT, STRING)])
    for stand_in in vocabulary.stand_ins.values():
        yield node_type(stand_in.name, stand_in.type.category, stand_in.type.ports.values())
