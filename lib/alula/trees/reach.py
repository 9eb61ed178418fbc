"""How each node of a tree may end, and so which children are never ticked; which nodes may take several ticks."""

from __future__ import annotations

from alula.trees.ends import ANY_END, Ends
from alula.trees.node import Wiring
from alula.trees.status import FAILURE, SKIPPED, SUCCESS, Answer

_CONDITIONS: dict[str, Answer] = {"_skipIf": SKIPPED, "_while": SKIPPED, "_successIf": SUCCESS, "_failureIf": FAILURE}


class Reach:
    """How nodes of trees may end and run, found without ticking them; computed once for each."""

    def __init__(self) -> None:
        self._ends: dict[Wiring, Ends] = {}
        self._runs: dict[Wiring, bool | None] = {}
        self._endless: dict[Wiring, Wiring | None] = {}

    def ends(self, wiring: Wiring) -> Ends:
        """Return how a node may end; none at all: it only ever runs."""
        if wiring not in self._ends:
            conditions = {end for name, end in _CONDITIONS.items() if name in wiring.element.attributes}
            self._ends[wiring] = self.own_ends(wiring) | conditions
        return self._ends[wiring]

    def own_ends(self, wiring: Wiring) -> Ends:
        """Return how a node may end where none of its conditions decides."""
        known = wiring.described
        return ANY_END if known is None else known.may_end(wiring.ports.get, [self.ends(child) for child in wiring.children])

    def runs(self, wiring: Wiring) -> bool | None:
        """Return whether a node, or one below it, may answer RUNNING; None: not known."""
        if wiring not in self._runs:
            answers = {wiring.may_run, *(self.runs(child) for child in wiring.children)}
            self._runs[wiring] = True if True in answers else None if None in answers else False
        return self._runs[wiring]

    def endless(self, wiring: Wiring) -> Wiring | None:
        """Return the first leaf of a node that runs until it is halted, and never succeeds; None where there is none."""
        if wiring not in self._endless:
            below = (leaf for child in wiring.children if (leaf := self.endless(child)) is not None)
            is_one = not wiring.children and wiring.may_run is True and SUCCESS not in self.own_ends(wiring)
            self._endless[wiring] = wiring if is_one else next(below, None)
        return self._endless[wiring]

    def never_ticked(self, wiring: Wiring) -> list[tuple[Wiring, Wiring]]:
        """Return the children of a node that are never ticked, each with the one that does not end as it would have to for that."""
        known, children = wiring.described, wiring.children
        if known is None:
            return []
        found = known.never_ticked(wiring.ports.get, [self.ends(child) for child in children])
        return [(children[number], children[waits_for]) for number, waits_for in found]
