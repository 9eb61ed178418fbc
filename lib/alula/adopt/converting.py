"""Trees of others with the nodes of a robot: the same nodes at the same places, by the names that the robot has for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from alula.adopt.vocabulary import HOLDS, SkillOf, Vocabulary
from alula.missions.mission_file import READY, STOP_HERE
from alula.missions.skill_types import STATE_PORT
from alula.trees.attributes import AUTOREMAP, is_port, type_name
from alula.trees.document import Attribute, Element
from alula.trees.node import pointer
from alula.trees.node_type import CATEGORIES, Category, NodeType
from alula.trees.ports import Direction

TREES = {READY: f"{READY}_tree", STOP_HERE: f"{STOP_HERE}_tree"}
"""IDs of trees that mean something in a mission, and what becomes of them."""
SAME_NAME = "{=}"
"""Of a port: the entry that has its name."""


def converted(tree: Element, name: str, vocabulary: Vocabulary) -> Element:
    """Return a copy of a tree of others as the tree of a mission, under a name."""
    copy = _copied(tree, vocabulary)
    copy.set("ID", TREES.get(name, name))
    return copy


def _copied(element: Element, vocabulary: Vocabulary) -> Element:
    content = [part if isinstance(part, str) else _copied(part, vocabulary) for part in element.content]
    copy = replace(element, attributes={name: replace(one) for name, one in element.attributes.items()}, content=content)
    kind = type_name(element)
    if element.tag == Category.SUBTREE.value:
        copy.set("ID", TREES.get(kind, kind))
        _give_defaults(copy, vocabulary.subtrees.get(kind))
    elif (skill := vocabulary.skills.get(kind)) is not None:
        _rename(copy, f"{vocabulary.robot}.{skill.name}", Category.ACTION)
        _give_ports(copy, skill)
        _keep_name(copy, kind)
    elif (resource := vocabulary.resource(element)) is not None:
        _rename(copy, f"{vocabulary.robot}.{resource.name}", Category.CONDITION)
        copy.attributes = {name: one for name, one in copy.attributes.items() if not is_port(name)}
        copy.set(STATE_PORT, HOLDS)
        _keep_name(copy, resource.text)
    elif (stand_in := vocabulary.stand_ins.get(kind)) is not None:
        _rename(copy, stand_in.name, stand_in.type.category)
        told = {name for name, port in stand_in.type.ports.items() if port.direction is Direction.OUTPUT}
        copy.attributes = {name: one for name, one in copy.attributes.items() if name not in told or pointer(one.value, name) is not None}
    return copy


def _give_defaults(use: Element, model: NodeType | None) -> None:
    """Give the use of a subtree what the model of that has by default, as BehaviorTree.CPP does where the use gives nothing."""
    for port in model.ports.values() if model is not None and AUTOREMAP not in use.attributes else ():
        if port.default and port.name not in use.attributes:
            use.set(port.name, f"{{{port.name}}}" if port.default == SAME_NAME else port.default)


def _rename(element: Element, name: str, category: Category) -> None:
    """Have a node be of a type: an ID stays an ID, a tag a tag."""
    tag = name
    if element.tag in CATEGORIES:
        element.set("ID", name)
        tag = category.value
    element.closing = element.closing.replace(element.tag, tag, 1)
    element.tag = tag


def _keep_name(element: Element, name: str) -> None:
    """Have a node that has no name be called as it was: that is what people know."""
    if "name" not in element.attributes:
        element.attributes = {"name": Attribute("name", name, element.place), **element.attributes}


def _give_ports(element: Element, skill: SkillOf) -> None:
    """Have ports called as the skill calls them; inputs that only the declaration has get its default, outputs that name no entry go."""
    attributes: list[Attribute] = []
    for one in element.attributes.values():
        given = replace(one, value=f"{{{one.name}}}", source="") if one.value == SAME_NAME else one
        attributes += [one] if not is_port(one.name) else []
        attributes += [replace(given, name=skill.inputs[one.name])] if one.name in skill.inputs else []
        if one.name in skill.outputs and pointer(one.value, one.name) is not None:
            attributes.append(replace(given, name=skill.outputs[one.name]))
    element.attributes = {one.name: one for one in attributes}
    for port, name in skill.inputs.items():
        default = skill.type.ports[port].default
        if name not in element.attributes and default is not None:
            element.set(name, f"{{{port}}}" if default == SAME_NAME else default)


def complete(tree: Element, vocabulary: Vocabulary, zeros: Mapping[tuple[str, str], str]) -> None:
    """Add the inputs that a use leaves out, as a skill needs all of its inputs; ``zeros`` has their values by skill and input."""
    skills = {f"{vocabulary.robot}.{one.name}": one for one in vocabulary.skills.values()}
    for node in tree.iterate():
        skill = skills.get(type_name(node))
        for name in skill.inputs.values() if skill else ():
            if name not in node.attributes:
                node.set(name, zeros[skill.name, name] if skill else "")
