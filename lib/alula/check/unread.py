"""Entries of the blackboard that are written and never read: nothing comes of them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from alula.check.entries import Key
from alula.check.problems import in_value, of_value
from alula.check.scripts import Scripts
from alula.check.whole import Whole
from alula.common.suggestions import nearest
from alula.missions.mission_file import DEGRADED, STOPPING
from alula.trees.access import scripts_of, takes_script_from_entry
from alula.trees.document import Attribute
from alula.trees.errors import Problem
from alula.trees.node import Wiring, pointer
from alula.trees.palette import Direction
from alula.trees.script.syntax import Assignment, Name, Node, children

TOLD = frozenset({DEGRADED, STOPPING})
"""Entries that the mission itself reads."""
_WORD = re.compile(r"@?[A-Za-z_]\w*")


def never_read(whole: Whole) -> Iterator[Problem]:
    """Yield the first writing of each entry that nothing in the files reads; who else reads entries of a foreign mission, nobody knows."""
    roots = (whole.root, *whole.beside)
    if whole.given is None or whole.foreign or any(_reads_anything(wiring) for root in roots for wiring in root.walk()):
        return
    board = whole.root.blackboard
    read = {board.where(name) for name in (*whole.given, *TOLD)}
    for root in roots:
        found = {key for wiring in root.walk() for key in _read(wiring, whole.scripts)}
        read |= found if root is whole.root else {key for key in found if key[0] is board}
    names = sorted({name for _, name in read})
    told: set[Key] = set()
    for wiring in whole.root.walk():
        for name, attribute, place in _written(wiring, whole.scripts):
            key = wiring.blackboard.where(name)
            included = attribute.place.path != whole.root.element.place.path  # another mission that includes it may read it
            if key not in read and key not in told and not included:
                told.add(key)
                yield _unread(name, attribute, place, names)


def _unread(name: str, attribute: Attribute, place: tuple[int, int] | None, names: list[str]) -> Problem:
    message = f"`{name}` is written, and nothing reads it"
    alike = nearest(name, names)
    cure = (
        alike if alike.startswith("did you mean") else "take it away, or have the mission tell it: an output port of the main tree's model"
    )
    if place is None:
        return of_value("ALU624", attribute, message, cure, warning=True)
    return in_value("ALU624", attribute, place, message, cure, warning=True)


def _reads_anything(wiring: Wiring) -> bool:
    """Tell whether a node may read entries that its element does not name."""
    return wiring.type.unknown or takes_script_from_entry(wiring.element, wiring.type)


def _read(wiring: Wiring, scripts: Scripts) -> Iterator[Key]:
    for attribute in scripts_of(wiring.element, wiring.type):
        program = scripts.program(attribute)
        for statement in program.statements if program else ():
            yield from (wiring.blackboard.where(name) for name in _names(statement))
    for word in _WORD.findall(wiring.element.get("_description")):
        yield wiring.blackboard.where(word)
    for attribute in wiring.port_attributes() if not wiring.is_subtree else ():
        port = wiring.type.ports.get(attribute.name)
        key = pointer(attribute.value, attribute.name)
        if key is not None and (port is None or port.direction is not Direction.OUTPUT):
            yield wiring.blackboard.where(key)


def _names(node: Node) -> Iterator[str]:
    """Yield the names that a script reads; what it only counts up is not read by that."""
    match node:
        case Name(name=name):
            yield name
        case Assignment(value=value):
            yield from _names(value)
        case _:
            for child in children(node):
                yield from _names(child)


def _written(wiring: Wiring, scripts: Scripts) -> Iterator[tuple[str, Attribute, tuple[int, int] | None]]:
    """Yield what a node writes: the entry, and where the file says so."""
    for attribute in scripts_of(wiring.element, wiring.type):
        program = scripts.program(attribute)
        for statement in program.statements if program else ():
            for target in _targets(statement):
                yield target.name, attribute, (target.offset, target.end)
    for attribute in wiring.port_attributes() if not wiring.is_subtree else ():
        port = wiring.type.ports.get(attribute.name)
        key = pointer(attribute.value, attribute.name)
        if port is not None and port.written_from and key is None:
            yield attribute.value, attribute, None
        elif port is not None and key is not None and port.direction is Direction.OUTPUT:
            yield key, attribute, None


def _targets(node: Node) -> Iterator[Name]:
    if isinstance(node, Assignment) and isinstance(node.target, Name):
        yield node.target
    for child in children(node):
        yield from _targets(child)
