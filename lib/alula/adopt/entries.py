"""Entries of the blackboards of trees: which types they have, which ports get theirs from them, and which of them a program writes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.adopt.vocabulary import SkillOf, Vocabulary
from alula.check.scripts import Scripts
from alula.missions.skill_types import PORT_TYPES, STATE_PORT
from alula.trees.access import NUMBER, TEXT, Access, Accesses, Key
from alula.trees.attributes import type_name
from alula.trees.blackboard import Blackboard
from alula.trees.configuration import configure
from alula.trees.node import NodeConfig, Shared, pointer
from alula.trees.node_type import Category, NodeType, node_type
from alula.trees.ports import Direction, Port
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.values import ANY, DOUBLE, NUMBERS, STRING, TYPES, PortType, literal

Slot = tuple[str, str]
"""A skill's input or output: the names of both."""
MODEL_TYPES = {kind: name for name, kind in PORT_TYPES.items() if name != "float32"}
"""Types of the models for types of ports."""
ZEROS: Mapping[str, object] = {"bool": False, "string": "", "float64": 0.0}
"""What stands for a value that nobody gives, by type of the models; of whole numbers 0."""


def model_type(kind: PortType) -> str:
    """Return the model's type for a port's: a text for each type that BehaviorTree.CPP converts from text by the program's own code."""
    return MODEL_TYPES.get(kind, "string")


@dataclass(frozen=True)
class GivenEntry:
    """An entry that a main tree reads before it writes it, so that a program has to; ``value`` stands for what that gives."""

    name: str
    value: object


@dataclass(frozen=True)
class _MainTree:
    """A main tree with all accesses to entries in it; ``optional``: entries of its board that nodes do without."""

    files: TreeFiles
    board: Blackboard
    accesses: Sequence[tuple[NodeConfig, Access]]
    optional: frozenset[str]

    @classmethod
    def of(cls, files: TreeFiles, registry: NodeRegistry) -> _MainTree:
        board = Blackboard(int)
        if not files.trees[files.main].children:
            return cls(files, board, (), frozenset())
        root = configure(files, registry, files.main, Shared(int), blackboard=board)
        accesses = Accesses(Scripts().statements)
        configs = {id(one): config for config in root.walk() for one in accesses.of_node(config)}
        several = [(configs[id(one)], one) for one in accesses.of(root) if one.write or one.needed]
        return cls(files, board, several, frozenset(_optional(root)))

    def read_first(self) -> dict[str, Access]:
        """Return the entries of its board that are read before they are written, each with where."""
        first: dict[Key, Access] = {}
        for _, access in self.accesses:
            first.setdefault(access.key, access)
        return {name: access for (board, name), access in first.items() if board is self.board and not access.write}

    def told(self) -> dict[str, str | None]:
        """Return the inputs that its model declares, with their defaults."""
        model = self.files.models.get(self.files.main)
        ports = model.ports.values() if model is not None else ()
        return {port.name: port.default for port in ports if port.direction is not Direction.OUTPUT}

    def unwritten(self) -> set[str]:
        """Return the entries that nodes read only if present, and that nothing writes."""
        return set(self.optional) - {access.key[1] for _, access in self.accesses if access.write and access.key[0] is self.board}


def _optional(root: NodeConfig) -> Iterator[str]:
    for config in root.walk():
        for port in config.type.ports.values():
            key = pointer(config.element.get(port.name), port.name) if port.optional else None
            board, name = (None, "") if key is None else config.blackboard.where(key)
            if board is root.blackboard:
                yield name


class Entries:
    """The types and uses of entries in main trees, whose nodes already have the robot's names."""

    def __init__(self, mains: Sequence[TreeFiles], vocabulary: Vocabulary, known: NodeRegistry) -> None:
        self._skills = {f"{vocabulary.robot}.{one.name}": one for one in vocabulary.skills.values()}
        self._types: dict[Slot, PortType] = dict(_declared(vocabulary))
        registry = known | NodeRegistry(_types(vocabulary))
        self._mains = {id(files): _MainTree.of(files, registry) for files in mains}
        self._refuse_literals()
        self._spread()

    def type(self, skill: str, name: str) -> str:
        """Return the type of an input or output, as models have it."""
        return model_type(self._types[skill, name])

    def zeros(self) -> Mapping[Slot, str]:
        """Return the values, as text, of inputs that a use leaves out."""
        return {slot: "" if kind == "string" else json.dumps(ZEROS.get(kind, 0)) for slot in self._types for kind in [self.type(*slot)]}

    def given(self, files: TreeFiles) -> list[GivenEntry]:
        """Return the entries that a program writes before it starts a main tree."""
        main = self._mains[id(files)]
        read, told = main.read_first(), main.told()
        enumerators = [name for name, access in sorted(read.items()) if name.isupper() and access.offsets is not None]
        found = []
        for name in sorted({*read, *told, *main.unwritten()}):
            default = told.get(name)
            if default is not None and pointer(default, name) is None:
                value = literal(default)
            elif name in enumerators:  # each of a program's has a number of its own
                value = enumerators.index(name) + 1
            else:
                value = ZEROS.get(self._kind([pair for pair in main.accesses if pair[1].key == (main.board, name)]), 0)
            found.append(GivenEntry(name, value))
        return found

    def _slot(self, config: NodeConfig, port: str) -> Slot | None:
        skill = self._skills.get(config.type.name)
        return (skill.name, port) if skill is not None and (skill.name, port) in self._types else None

    def _refuse_literals(self) -> None:
        """Have a port take texts where a use gives it one that its type can't be read from, such as an enumerator of a program's."""
        nodes = [node for main in self._mains.values() for tree in main.files.trees.values() for node in tree.iterate()]
        for node in nodes:
            skill = self._skills.get(type_name(node))
            for attribute in node.attributes.values() if skill else ():
                kind = self._types.get((skill.name if skill else "", attribute.name))
                if kind is not None and pointer(attribute.value, attribute.name) is None and not _reads(kind, attribute.value):
                    self._types[skill.name if skill else "", attribute.name] = STRING

    def _spread(self) -> None:
        """Give what has no type yet that of the entries which it names, until nothing changes."""
        groups = [list(_by_key(main.accesses).values()) for main in self._mains.values()]
        changed = True
        while changed:
            changed = False
            for pairs in (pairs for found in groups for pairs in found):
                kind = self._common(pairs)
                for config, access in pairs:
                    slot = self._slot(config, access.attribute.name)
                    if kind is not ANY and slot is not None and self._types[slot] is ANY:
                        self._types[slot], changed = kind, True

    def _common(self, pairs: Iterable[tuple[NodeConfig, Access]]) -> PortType:
        """Return the type that all who name an entry agree on: of several kinds of number the widest, else a text; ANY where nobody says.

        A number of a script is of any of these kinds.
        """
        told = [(self._told(config, access), access.type == NUMBER) for config, access in pairs]
        kinds = {kind for kind, is_of_script in told if kind is not ANY and not is_of_script}
        if not kinds:
            return DOUBLE if any(is_of_script for _, is_of_script in told) else ANY
        if len(kinds) == 1:
            return next(iter(kinds))
        return DOUBLE if kinds <= set(NUMBERS) else STRING

    def _told(self, config: NodeConfig, access: Access) -> PortType:
        slot = self._slot(config, access.attribute.name) if access.offsets is None else None
        if slot is not None:
            return self._types[slot]
        return STRING if access.type == TEXT else TYPES.get(access.type, ANY)

    def _kind(self, pairs: Sequence[tuple[NodeConfig, Access]]) -> str:
        kind = self._common(pairs)
        is_of_scripts = all(access.offsets is not None for _, access in pairs) and pairs
        return "float64" if kind is ANY and is_of_scripts else model_type(kind)


def _by_key(accesses: Iterable[tuple[NodeConfig, Access]]) -> dict[Key, list[tuple[NodeConfig, Access]]]:
    found: dict[Key, list[tuple[NodeConfig, Access]]] = {}
    for config, access in accesses:
        found.setdefault(access.key, []).append((config, access))
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
