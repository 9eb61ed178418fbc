"""What becomes of the nodes of trees: an action is a skill, a condition a resource, a node with children a class that stands in for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from alula.adopt.foreign import nodes_of
from alula.adopt.naming import Names
from alula.model.ros_types import camel
from alula.trees.attributes import is_port, type_name
from alula.trees.document import Element
from alula.trees.node_type import Category, NodeType
from alula.trees.ports import Direction

HOLDS, FAILS = "HOLDS", "FAILS"
"""The states of a resource that a condition has become."""
LEAVES = (Category.ACTION, Category.CONDITION)
Arguments = tuple[tuple[str, str], ...]
"""Ports with what a use gives them."""


@dataclass(frozen=True)
class SkillOf:
    """An action as a skill; the skill's names by those of the ports, one that is read and written has two."""

    type: NodeType
    name: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]


@dataclass(frozen=True)
class ResourceOf:
    """A condition as a resource: of one that is asked with several arguments, each is one of its own."""

    type: NodeType
    name: str
    arguments: Arguments

    @property
    def text(self) -> str:
        """The condition with its arguments, for people."""
        return " ".join([self.type.name, *(f"{port}={value}" for port, value in self.arguments)])

    @property
    def asks_entries(self) -> bool:
        """Return whether an argument is an entry of the blackboard, whose value the answer depends on."""
        return any("{" in value for _, value in self.arguments)


@dataclass(frozen=True)
class StandIn:
    """A node with children that only a program has, as a class of the robot's."""

    type: NodeType
    name: str
    class_name: str


@dataclass
class Vocabulary:
    """What the nodes of trees are called in a robot, by their IDs."""

    robot: str
    types: Mapping[str, NodeType]
    subtrees: Mapping[str, NodeType]
    """Of trees, as far as files declare their ports."""
    skills: dict[str, SkillOf] = field(default_factory=dict)
    resources: dict[tuple[str, Arguments], ResourceOf] = field(default_factory=dict)
    stand_ins: dict[str, StandIn] = field(default_factory=dict)

    @classmethod
    def of(cls, robot: str, types: Mapping[str, NodeType], subtrees: Mapping[str, NodeType], trees: Iterable[Element]) -> Vocabulary:
        """Return the vocabulary of trees: actions are named first, then conditions."""
        self = cls(robot, types, subtrees)
        names, classes = Names("node"), Names("node", ["part", "pass_through", "in_turn", "read_inputs"])
        actions = [one for one in types.values() if one.category in LEAVES and not _is_asked(one)]
        self.skills = {one.name: _skill(one, names.add(one.name)) for one in actions}
        asked: dict[str, dict[Arguments, None]] = {}
        for node in (node for tree in trees for node in nodes_of(tree)):
            if type_name(node) in types and _is_asked(types[type_name(node)]):
                asked.setdefault(type_name(node), {}).setdefault(arguments(node))
        for name, uses in sorted(asked.items()):
            for use in uses:
                text = " ".join([name, *(value for _, value in use if len(uses) > 1)])
                self.resources[name, use] = ResourceOf(types[name], names.add(text), use)
        for one in types.values():
            if one.category not in LEAVES:
                self.stand_ins[one.name] = StandIn(one, f"{robot}.{one.name}", camel(classes.add(one.name)))
        return self

    def resource(self, node: Element) -> ResourceOf | None:
        """Return the resource that a condition asks, None for another node."""
        return self.resources.get((type_name(node), arguments(node)))


def arguments(node: Element) -> Arguments:
    """Return the arguments of a node, by port."""
    return tuple(sorted((name, one.value) for name, one in node.attributes.items() if is_port(name)))


def _is_asked(one: NodeType) -> bool:
    """Return whether a node is a condition with inputs only; one that writes entries, too, has to be a skill."""
    return one.category is Category.CONDITION and all(port.direction is Direction.INPUT for port in one.ports.values())


def _skill(one: NodeType, name: str) -> SkillOf:
    names = Names("port")
    ports = one.ports.values()
    inputs = {port.name: names.add(port.name) for port in ports if port.direction is not Direction.OUTPUT}
    told = [port for port in ports if port.direction is not Direction.INPUT]
    outputs = {port.name: names.add(f"{port.name}_out" if port.name in inputs else port.name) for port in told}
    return SkillOf(one, name, inputs, outputs)
