"""Entries of the blackboard: read before anything can have written them, written or read with types or units that don't fit."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

from alula.check.problems import of_access
from alula.common.suggestions import nearest
from alula.trees.access import NUMBER, TEXT, UNKNOWN, Access, Accesses, Key
from alula.trees.attributes import PRECONDITIONS
from alula.trees.errors import Problem
from alula.trees.node import NodeConfig, pointer
from alula.trees.status import SUCCESS
from alula.trees.values import NUMBERS, STRING, TYPES

_NUMERIC = frozenset({NUMBER, *(one.name for one in NUMBERS)})
_ASKED = frozenset(PRECONDITIONS)


Writers = dict[Key, Access]
"""What writes entries first, by entry."""


def written(root: NodeConfig, accesses: Accesses) -> Writers:
    """Return what first writes each entry of the blackboard that a tree itself stands on."""
    return {key: access for key, access in _written_in(root, accesses).items() if key[0] is root.blackboard}


def _written_in(root: NodeConfig, accesses: Accesses) -> Writers:
    return {access.key: access for access in reversed(list(accesses.of(root))) if access.write}


def read_too_early(
    root: NodeConfig, accesses: Accesses, given: Collection[str], others: Writers, *, late: bool, foreign: bool
) -> Iterator[Problem]:
    """Yield each reading of an entry that nothing can have written by then.

    ``given`` is what the blackboard has at the start, ``others`` what another tree writes on it: after this one has begun, or, with
    ``late``, perhaps before.
    """
    by_then = {root.blackboard.where(name) for name in given}
    later = {**others, **_written_in(root, accesses)}
    names = sorted({access.name for access in later.values()} | set(given))
    taken: dict[Key, NodeConfig] = {}

    def visit(config: NodeConfig, *, within: bool = False) -> Iterator[Problem]:
        yield from judged(accesses.before(config))
        if not within and goes_back(config):  # what one writes, any other may find
            within = True
            by_then.update(access.key for child in config.children for access in accesses.of(child) if access.write)
        unset: set[Key] = set()
        for child in config.children:
            yield from visit(child, within=within)
            unset |= {key for key in _unset(config, child) if key in by_then}
            by_then.difference_update(unset & set(_unset(config, child)))
            taken.update(dict.fromkeys(_unset(config, child), child))
        by_then.update(unset)  # behind this node nobody knows whether it came to that
        yield from judged(accesses.after(config))

    def judged(found: list[Access]) -> Iterator[Problem]:
        for access in found:
            if access.write:
                by_then.add(access.key)
            elif access.needed and access.key not in by_then:
                by_then.add(access.key)  # one finding for an entry is enough
                if access.key in taken:
                    yield _taken_away(access, taken[access.key])
                elif late and access.key in others:
                    yield replace(_perhaps_unwritten(access, others[access.key]), warning=True)
                else:
                    outside = foreign and access.key not in later and access.key[0] is root.blackboard
                    yield replace(_unwritten(access, later.get(access.key), names), warning=outside or bool(access.unchecked))

    yield from visit(root)


def _perhaps_unwritten(access: Access, writer: Access) -> Problem:
    message = f"`{access.name}` is read, and this tree may begin before line {writer.attribute.place.line} has written it"
    return of_access(access, "ALU607", message, "have it from the start: an output port of the main tree's model, with a default")


def goes_back(config: NodeConfig) -> bool:
    """Return whether a child of a node may be ticked after another one that stands behind it."""
    return config.ticking.goes_back(len(config.children))


def _unset(parent: NodeConfig, child: NodeConfig) -> tuple[Key, ...]:
    """Return the entry that a child has surely taken away when the next one's turn comes."""
    port = child.described.takes_away if child.described else ""
    if not port:
        return ()
    key = child.ports.get(port) or ""
    in_order = parent.ticking.lists and parent.ticking.goes_on is SUCCESS
    sure = in_order and not any(goes_back(one) for one, _ in child.above())
    if not sure or pointer(key, port) is not None or _ASKED.intersection(child.element.attributes):
        return ()
    return (child.blackboard.where(key),)


def _taken_away(access: Access, by: NodeConfig) -> Problem:
    message = f"`{access.name}` is read, and {by.type.name} in line {by.element.place.line} has taken it away"
    return of_access(access, "ALU607", message, "read it before, or write it again")


def _unwritten(access: Access, writer: Access | None, names: list[str]) -> Problem:
    if writer is not None:
        message = f"`{access.name}` is read here before anything can have written it: line {writer.attribute.place.line} does later"
        return of_access(access, "ALU607", message, "write it before, or ask for it later")
    message = f"`{access.name}` is read, and nothing before writes it"
    if access.unchecked:
        message = f"`{access.name}` is read, nothing before writes it, and '{access.unchecked}' goes on with an empty one"
    alike = nearest(access.name, names)
    cure = alike if alike.startswith("did you mean") else f'write it before: <Script code="{access.name} := ..."/>'
    return of_access(access, "ALU607", message, cure)


def mismatched(root: NodeConfig, accesses: Accesses) -> Iterator[Problem]:
    """Yield entries that are written with two types, or read as another type or in another unit than they are written."""
    writers: dict[Key, Access] = {}
    readers: list[Access] = []
    for access in accesses.of(root):
        if not access.write:
            readers += [access] if access.needed else []
        elif not access.type:
            continue
        elif not _same_type(access.type, writers.setdefault(access.key, access).type):
            first = writers[access.key]
            message = f"`{access.name}` is written as {access.type} here and as {first.type} in line {first.attribute.place.line}"
            yield of_access(access, "ALU608", message, "an entry keeps its type: write another entry")
    for access in readers:
        known = writers.get(access.key)
        if known is None:
            continue
        line = known.attribute.place.line
        if not _readable(known.type, access.type):
            message = f"`{access.name}` is read as {access.type} and is written as {known.type} in line {line}"
            yield of_access(access, "ALU605", message, "read an entry of this type")
        elif access.unit and known.unit and access.unit != known.unit:
            message = f"`{access.name}` is read in {access.unit} and is written in {known.unit} in line {line}"
            yield of_access(access, "ALU606", message, f"convert it in a script, into another entry in {access.unit}")


def _same_type(one: str, other: str) -> bool:
    numbers = NUMBER in {one, other} and {one, other} <= _NUMERIC
    return one == other or numbers or {one, other} == {TEXT, STRING.name}


def _readable(written: str, read: str) -> bool:
    """Return whether a value goes into a port: numbers and texts are converted as it is read, others have to be of its type."""
    basic = {*TYPES, NUMBER, TEXT, UNKNOWN}
    return written == read or not written or not read or (written in basic and read in basic)
