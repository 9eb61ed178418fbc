"""What a checker knows of a type of node: how it may end, and whether it may take several ticks."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from alula.check.sites import Site
from alula.trees.ends import Ends
from alula.trees.palette import Category


class Traits(Protocol):
    """What is known of leaves, and of names in scripts."""

    def ends(self, site: Site) -> Ends | None:
        """Return how a node may end where more is known than its type tells, None where not."""

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

    def ends(self, site: Site) -> Ends | None:  # noqa: ARG002
        """Know no more than the types."""
        return None

    def runs(self, site: Site) -> bool | None:
        """Tell what the type does; a condition answers at once."""
        if site.type is not None and site.type.category is Category.CONDITION:
            return False
        return site.described.may_run if site.described else site.type.runs if site.type else None

    def endless(self, site: Site) -> bool:  # noqa: ARG002
        """Know none."""
        return False

    def is_name(self, name: str) -> bool:
        """Tell whether it is an enum's or a dotted name."""
        return name in self._names or "." in name

    def is_optional(self, site: Site, port: str) -> bool:
        """Tell what the type tells of the port."""
        known = site.type.ports.get(port) if site.type else None
        return known is not None and known.optional
