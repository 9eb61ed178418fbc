"""How each node may end, and so which children are never ticked; which nodes may take several ticks where only one may."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, pairwise

from alula.check.problems import of_element
from alula.check.sites import Site
from alula.check.traits import Traits
from alula.trees.ends import ANY_END, Ends, whole_number
from alula.trees.errors import Problem
from alula.trees.nodes.parallel import threshold_of
from alula.trees.status import FAILURE, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import AGAIN, Order

_CONDITIONS: dict[str, Answer] = {"_skipIf": SKIPPED, "_while": SKIPPED, "_successIf": SUCCESS, "_failureIf": FAILURE}
_WORDS: dict[Answer, str] = {FAILURE: "fails", SKIPPED: "is skipped", SUCCESS: "succeeds"}


class Reach:
    """How the nodes of a tree may end; computed once for each."""

    def __init__(self, traits: Traits) -> None:
        self._traits = traits
        self._known: dict[Site, Ends] = {}
        self._runs: dict[Site, bool | None] = {}
        self._endless: dict[Site, Site | None] = {}

    def ends(self, site: Site) -> Ends:
        """Return how a node may end; none at all: it only ever runs."""
        if site not in self._known:
            conditions = {end for name, end in _CONDITIONS.items() if name in site.element.attributes}
            self._known[site] = self._own(site) | conditions
        return self._known[site]

    def runs(self, site: Site) -> bool | None:
        """Tell whether a node may take several ticks; None: nobody knows."""
        if site not in self._runs:
            answers = {self._traits.runs(site), *(self.runs(child) for child in site.children)}
            self._runs[site] = True if True in answers else None if None in answers else False
        return self._runs[site]

    def endless(self, site: Site) -> Site | None:
        """Return the first leaf of a node that runs until it is halted; None where there is none."""
        if site not in self._endless:
            own = site if self._traits.endless(site) else None
            self._endless[site] = own or next((leaf for child in site.children if (leaf := self.endless(child)) is not None), None)
        return self._endless[site]

    def never_ticked(self, site: Site) -> list[tuple[Site, Site]]:
        """Return the children of a node that are never ticked, each with the one that does not end as it would have to for that."""
        known, children = site.described, site.children
        if known is None:
            return []
        found = known.never_ticked(site.given, [self.ends(child) for child in children])
        return [(children[number], children[waits_for]) for number, waits_for in found]

    def _own(self, site: Site) -> Ends:
        told = self._traits.ends(site)
        if told is not None:
            return told
        known = site.described
        return ANY_END if known is None else known.may_end(site.given, [self.ends(child) for child in site.children])


def needed(site: Site) -> int | None:
    """Return how many children of a node that ticks them at once have to succeed; None where that is known when it is ticked only."""
    port = site.ticking.succeeds_after
    count = whole_number(site.given, port) if port else -1
    return None if count is None else threshold_of(count, len(site.children))


def unreached(root: Site, reach: Reach) -> Iterator[tuple[Site, Site]]:
    """Yield each child that is never ticked (of several in a row the first), with the one whose end is waited for in vain."""
    for site in root.walk():
        yield from reach.never_ticked(site)


def waits_in_vain(root: Site, reach: Reach) -> Iterator[tuple[Problem, Site]]:
    """Yield where the success of a leaf is waited for that runs until it is halted, with the node that is waited for."""
    found: set[Site] = set()
    for site in root.walk():
        for child, why in _waited(site, reach):
            leaf = reach.endless(child)
            if leaf is not None and leaf not in found and SUCCESS not in reach.ends(child):
                found.add(leaf)
                yield _in_vain(leaf, why), child
    if not found and SUCCESS not in reach.ends(root):
        leaf = reach.endless(root)
        if leaf is not None:
            yield _in_vain(leaf, "the tree never succeeds"), root


def _waited(site: Site, reach: Reach) -> Iterator[tuple[Site, str]]:
    """Yield the children whose success a node waits for, with what that keeps from coming."""
    ticking = site.ticking
    if ticking.lists and ticking.goes_on is SUCCESS:
        for child, following in pairwise(site.children):
            yield child, f"'{following.name}' after it is never reached"
    elif ticking.order is Order.SINGLE and {AGAIN, SUCCESS} <= ticking.follows(SUCCESS):
        yield site.children[0], f"'{site.name}' never repeats it"
    elif is_parallel(site) and SUCCESS not in reach.ends(site):
        yield from ((child, f"'{site.name}' waits for the success of {needed(site)} of its children") for child in site.children)


def _in_vain(leaf: Site, why: str) -> Problem:
    message = f"'{leaf.name}' runs until it is interrupted and never succeeds: {why}"
    cure = "put it into a Parallel beside what it accompanies, and let success_count not count it"
    return of_element("ALU612", leaf.element, message, cure)


def never_reached(child: Site, waits_for: Site, reach: Reach) -> Problem:
    """Return the problem of a child that is never ticked."""
    ends = " or ".join(word for end, word in _WORDS.items() if end in reach.ends(waits_for)) or "runs for ever"
    message = f"'{child.name}' is never reached: '{waits_for.name}' before it always {ends}"
    return of_element("ALU610", child.element, message, "take it away, or put it where it is reached")


def several_run(root: Site, reach: Reach, excluded: Callable[[Site, Site], bool]) -> Iterator[Problem]:
    """Yield where a reactive node has two children that may take several ticks: one that runs has the other halted."""
    for site in root.walk():
        if site.ticking.order is not Order.REACTIVE:
            continue
        running = [(child, runs) for child in site.children if (runs := reach.runs(child)) is not False]
        for one, other in combinations(running, 2):
            if excluded(one[0], other[0]):
                continue
            verb = "takes" if one[1] and other[1] else "may take"
            message = (
                f"'{other[0].name}' in a {site.kind} {verb} several ticks, as '{one[0].name}' before it: each may have the other halted"
            )
            cure = "put the two into a Sequence, ask a condition instead of the first, or give them `_while` that exclude each other"
            yield of_element("ALU611", other[0].element, message, cure, warning=True)
            break


def is_parallel(site: Site) -> bool:
    """Tell whether a node ticks several children at once."""
    return site.ticking.order is Order.AT_ONCE
