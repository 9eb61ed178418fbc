"""What a checker knows of a type of node: how it may end, and whether it may take several ticks."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from alula.check.sites import Site
from alula.trees.node import Action
from alula.trees.palette import Category

S, F, K = "succeeds", "fails", "is skipped"
"""Ends of a tick; to run is none."""
ENDS = frozenset({S, F})

_ENDS = {
    "AlwaysSuccess": {S},
    "AlwaysFailure": {F},
    "Script": {S},
    "Sleep": {S},
    "UnsetBlackboard": {S},
}
_RUNS = frozenset({"Sleep", "KeepRunningUntilFailure", "Delay", "AsyncSequence", "AsyncFallback", "WaitValueUpdate"})


class Traits(Protocol):
    """What is known of leaves, and of names in scripts."""

    def ends(self, site: Site) -> frozenset[str]:
        """Return how a leaf may end."""

    def runs(self, site: Site) -> bool | None:
        """Tell whether a node may take several ticks by itself, its children aside; None: nobody knows."""

    def endless(self, site: Site) -> bool:
        """Tell whether a leaf runs until it is halted: it never succeeds."""

    def is_name(self, name: str) -> bool:
        """Tell whether a name in a script stands for something else than an entry."""

    def is_optional(self, site: Site, port: str) -> bool:
        """Tell whether the node does without the entry that a port reads."""


class PlainTraits:
    """What BehaviorTree.CPP's own nodes are; ``names``: enums."""

    def __init__(self, names: Collection[str] = ()) -> None:
        self._names = names

    def ends(self, site: Site) -> frozenset[str]:
        """Return how a leaf may end: either way unless it is one of BehaviorTree.CPP's that never do."""
        return frozenset(_ENDS.get(site.kind, ENDS))

    def runs(self, site: Site) -> bool | None:
        """Tell what is known of BehaviorTree.CPP's nodes and of classes; an action that only a model tells of may."""
        if site.kind in _RUNS:
            return True
        if site.type is None or site.type.category is not Category.ACTION:
            return False
        return issubclass(site.type.make, Action) if isinstance(site.type.make, type) else None

    def endless(self, site: Site) -> bool:  # noqa: ARG002
        """Know none."""
        return False

    def is_name(self, name: str) -> bool:
        """Tell whether it is an enum's or a dotted name."""
        return name in self._names or "." in name

    def is_optional(self, site: Site, port: str) -> bool:
        """Tell whether the port asks whether there is such an entry."""
        return port == "entry" and site.kind in {"WasEntryUpdated", "SkipUnlessUpdated", "WaitValueUpdate"}
