"""What rules are given: a tree as it will stand, and what is known of it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from alula.check.entries import Writers
from alula.check.scripts import Scripts
from alula.trees.access import Accesses
from alula.trees.errors import Problem
from alula.trees.node import NodeConfig
from alula.trees.reach import Reach


@dataclass
class Whole:
    """A tree as it will stand, and what is known of it: what rules are made of."""

    root: NodeConfig
    scripts: Scripts
    accesses: Accesses
    reach: Reach
    names: Collection[str]
    """What names in scripts stand for besides entries: enums, states."""
    given: Collection[str] | None = None
    """Entries of its blackboard that are written before it starts; None: who starts it, and with which entries, is not in the files."""
    others: Writers = field(default_factory=dict)
    """What the main tree writes on the blackboard of another one."""
    begins_late: bool = False
    """It may begin before or after the main tree has written them."""
    foreign: bool = False
    beside: tuple[NodeConfig, ...] = ()
    """Other trees on the same blackboard: the main one, and those that stand beside it."""


Rule = Callable[[Whole], Iterable[Problem]]
