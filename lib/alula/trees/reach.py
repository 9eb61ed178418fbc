"""How each node of a tree may end, and so which children are never ticked; which nodes may take several ticks."""

from __future__ import annotations

from alula.trees.ends import ANY_END, Ends
from alula.trees.node import NodeConfig
from alula.trees.status import FAILURE, SKIPPED, SUCCESS, Answer

_CONDITIONS: dict[str, Answer] = {"_skipIf": SKIPPED, "_while": SKIPPED, "_successIf": SUCCESS, "_failureIf": FAILURE}


class Reach:
    """How nodes of trees may end and run, found without ticking them; computed once for each."""

    def __init__(self) -> None:
        self._ends: dict[NodeConfig, Ends] = {}
        self._runs: dict[NodeConfig, bool | None] = {}
        self._endless: dict[NodeConfig, NodeConfig | None] = {}

    def ends(self, config: NodeConfig) -> Ends:
        """Return how a node may end; none at all: it only ever runs."""
        if config not in self._ends:
            conditions = {end for name, end in _CONDITIONS.items() if name in config.element.attributes}
            self._ends[config] = self.own_ends(config) | conditions
        return self._ends[config]

    def own_ends(self, config: NodeConfig) -> Ends:
        """Return how a node may end where none of its conditions decides."""
        known = config.described
        return ANY_END if known is None else known.may_end(config.ports.get, [self.ends(child) for child in config.children])

    def runs(self, config: NodeConfig) -> bool | None:
        """Return whether a node, or one below it, may answer RUNNING; None: not known."""
        if config not in self._runs:
            answers = {config.may_run, *(self.runs(child) for child in config.children)}
            self._runs[config] = True if True in answers else None if None in answers else False
        return self._runs[config]

    def endless(self, config: NodeConfig) -> NodeConfig | None:
        """Return the first leaf of a node that runs until it is halted, and never succeeds; None where there is none."""
        if config not in self._endless:
            below = (leaf for child in config.children if (leaf := self.endless(child)) is not None)
            is_one = not config.children and config.may_run is True and SUCCESS not in self.own_ends(config)
            self._endless[config] = config if is_one else next(below, None)
        return self._endless[config]

    def never_ticked(self, config: NodeConfig) -> list[tuple[NodeConfig, NodeConfig]]:
        """Return the children of a node that are never ticked, each with the one that does not end as it would have to for that."""
        known, children = config.described, config.children
        if known is None:
            return []
        found = known.never_ticked(config.ports.get, [self.ends(child) for child in children])
        return [(children[number], children[waits_for]) for number, waits_for in found]
