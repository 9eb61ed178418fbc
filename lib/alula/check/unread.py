"""Entries of the blackboard that are written and never read: nothing comes of them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from alula.check.problems import of_access
from alula.check.whole import Whole
from alula.common.suggestions import nearest
from alula.missions.mission_file import DEGRADED, STOPPING
from alula.trees.access import Access, Accesses, Key, takes_script_from_entry
from alula.trees.errors import Problem
from alula.trees.node import NodeConfig

TOLD = frozenset({DEGRADED, STOPPING})
"""Entries that the mission itself reads."""
_WORD = re.compile(r"@?[A-Za-z_]\w*")


def never_read(whole: Whole) -> Iterator[Problem]:
    """Yield the first writing of each entry that nothing in the files reads; programs may read those of a foreign mission."""
    roots = (whole.root, *whole.beside)
    if whole.given is None or whole.foreign or any(_reads_anything(config) for root in roots for config in root.walk()):
        return
    board = whole.root.blackboard
    read = {board.where(name) for name in (*whole.given, *TOLD)}
    for root in roots:
        found = {key for config in root.walk() for key in _read(config, whole.accesses)}
        read |= found if root is whole.root else {key for key in found if key[0] is board}
    names = sorted({name for _, name in read})
    told: set[Key] = set()
    for config in whole.root.walk():
        for access in _written(config, whole.accesses):
            included = access.attribute.place.path != whole.root.element.place.path  # another mission that includes it may read it
            if access.key not in read and access.key not in told and not included:
                told.add(access.key)
                yield _unread(access, names)


def _unread(access: Access, names: list[str]) -> Problem:
    message = f"`{access.name}` is written, and nothing reads it"
    alike = nearest(access.name, names)
    cure = alike if alike.startswith("did you mean") else "take it away, or report it: an output port of the main tree's model"
    return of_access(access, "ALU624", message, cure, warning=True)


def _reads_anything(config: NodeConfig) -> bool:
    """Return whether a node may read entries that its element does not name."""
    return config.type.unknown or takes_script_from_entry(config.element, config.type)


def _read(config: NodeConfig, accesses: Accesses) -> Iterator[Key]:
    """Yield the entries that a node reads, also those that its description names."""
    yield from (one.key for one in accesses.of_node(config) if not one.write and not one.in_passing)
    yield from (config.blackboard.where(word) for word in _WORD.findall(config.element.get("_description")))


def _written(config: NodeConfig, accesses: Accesses) -> Iterator[Access]:
    """Yield what the file has a node write: not what it gives a subtree, and not what a port writes by default."""
    for one in accesses.of_node(config):
        if one.write and (one.value is not None or (not config.is_subtree and one.attribute.name in config.element.attributes)):
            yield one
