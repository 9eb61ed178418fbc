"""How each node may end, and so which children are never ticked; which nodes may take several ticks where only one may."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

from alula.check.problems import of_element
from alula.check.sites import Site
from alula.check.traits import ENDS, F, K, S, Traits
from alula.trees.errors import Problem
from alula.trees.palette import Category

Ends = frozenset[str]
NONE: Ends = frozenset()
IN_TURN = {
    **dict.fromkeys(("Sequence", "SequenceWithMemory", "AsyncSequence", "ReactiveSequence", "PipelineSequence", "NonblockingSequence"), S),
    **dict.fromkeys(("Fallback", "AsyncFallback", "ReactiveFallback"), F),
}
"""Nodes that tick their children in turn, with the end after which they go on."""
BRANCHES = ("IfThenElse", "WhileDoElse")
REACTIVE = ("ReactiveSequence", "ReactiveFallback")
_CONDITIONS = {"_skipIf": K, "_while": K, "_successIf": S, "_failureIf": F}
_ANSWERS = {"SUCCESS": S, "FAILURE": F, "SKIPPED": K}


class Reach:
    """How the nodes of a tree may end; computed once for each."""

    def __init__(self, traits: Traits) -> None:
        self._traits = traits
        self._known: dict[Site, Ends] = {}

    def ends(self, site: Site) -> Ends:
        """Return how a node may end; none at all: it only ever runs."""
        if site not in self._known:
            conditions = {end for name, end in _CONDITIONS.items() if name in site.element.attributes}
            self._known[site] = self._own(site) | conditions
        return self._known[site]

    def runs(self, site: Site) -> bool | None:
        """Tell whether a node may take several ticks; None: nobody knows."""
        own = self._traits.runs(site)
        answers = {own, *(self.runs(child) for child in site.children)}
        return True if True in answers else None if None in answers else False

    def stops_at(self, site: Site) -> int | None:
        """Return the child after which a node that ticks them in turn never goes on, None where it may get to its last."""
        goes_on = {IN_TURN[site.kind], K}
        return next((number for number, child in enumerate(site.children) if not self.ends(child) & goes_on), None)

    def _own(self, site: Site) -> Ends:
        children = [self.ends(child) for child in site.children]
        if site.kind in IN_TURN:
            return _in_turn(children, IN_TURN[site.kind])
        if site.kind in BRANCHES and len(children) >= 2:
            otherwise = children[2] if len(children) > 2 else frozenset({F})
            return (children[1] if S in children[0] else NONE) | (otherwise if F in children[0] else NONE) | (children[0] & {K})
        if site.kind in {"Parallel", "ParallelAll"}:
            return _at_once(site, children)
        if len(children) == 1 and site.kind in _DECORATORS:
            return _DECORATORS[site.kind](site, children[0])
        if site.kind == "SubTree" or site.kind.startswith("Switch"):
            return frozenset().union(*children) or ENDS
        return ENDS | {K} if children else self._traits.ends(site)


def _in_turn(children: list[Ends], goes_on: str) -> Ends:
    other = F if goes_on == S else S
    found: set[str] = set()
    for ends in children:
        found |= ends & {other}
        if not ends & {goes_on, K}:
            return frozenset(found)
    if any(goes_on in ends for ends in children):
        found.add(goes_on)
    if all(K in ends for ends in children):
        found.add(K)
    return frozenset(found)


def needed(site: Site) -> int | None:
    """Return how many children of a Parallel have to succeed; None where that is known when it is ticked only."""
    return _threshold(site, "success_count", "-1") if site.kind == "Parallel" else len(site.children)


def _threshold(site: Site, port: str, default: str) -> int | None:
    try:
        count = int(site.given(port) or default)
    except ValueError:
        return None
    return max(len(site.children) + count + 1, 0) if count < 0 else count


def _at_once(site: Site, children: list[Ends]) -> Ends:
    enough = needed(site)
    many = _threshold(site, "failure_count" if site.kind == "Parallel" else "max_failures", "1")
    if enough is None or many is None:
        return ENDS
    succeeding = sum(bool(ends & {S, K}) for ends in children)
    if site.kind == "ParallelAll":  # as many as it lets fail need not succeed
        succeeding += min(many - 1, sum(not ends & {S, K} for ends in children))
    failing = sum(F in ends for ends in children)
    return frozenset({end for end, possible in ((S, succeeding >= enough), (F, failing >= many)) if possible})


def _forced(end: str) -> Callable[[Site, Ends], Ends]:
    return lambda _, ends: (frozenset({end}) if ends & ENDS else NONE) | (ends & {K})


def _swapped(_: Site, ends: Ends) -> Ends:
    return frozenset({{S: F, F: S}.get(end, end) for end in ends})


def _again(port: str, end: str) -> Callable[[Site, Ends], Ends]:
    """For ever: it never ends as it would go on."""
    return lambda site, ends: ends - {end} if (site.given(port) or "").strip() == "-1" else ends


def _more(*more: str) -> Callable[[Site, Ends], Ends]:
    return lambda _, ends: ends | frozenset(more)


def _precondition(site: Site, ends: Ends) -> Ends:
    other = _ANSWERS.get((site.given("else") or "FAILURE").strip())
    return ends | ({other} if other else NONE)


_DECORATORS: dict[str, Callable[[Site, Ends], Ends]] = {
    "Inverter": _swapped,
    "ForceSuccess": _forced(S),
    "ForceFailure": _forced(F),
    "Repeat": _again("num_cycles", S),
    "RetryUntilSuccessful": _again("num_attempts", F),
    "KeepRunningUntilFailure": lambda _, ends: ends & {F, K},
    "Delay": _more(),
    "RunOnce": _more(K),
    "Timeout": _more(F),
    "Precondition": _precondition,
    "SkipUnlessUpdated": _more(K),
    "WaitValueUpdate": _more(),
    "SubTree": _more(),
    **{f"Loop{item}": _more(S) for item in ("Int", "Bool", "Double", "String")},
}


def unreached(root: Site, reach: Reach) -> Iterator[tuple[Site, Site]]:
    """Yield each child that is never ticked (of several in a row the first), with the one whose end is waited for in vain."""
    for site in root.walk():
        if site.kind in IN_TURN:
            last = reach.stops_at(site)
            if last is not None and last + 1 < len(site.children):
                yield site.children[last + 1], site.children[last]
        elif site.kind in BRANCHES:
            for number, end in ((1, S), (2, F)):
                if number < len(site.children) and end not in reach.ends(site.children[0]):
                    yield site.children[number], site.children[0]


def waits_in_vain(root: Site, reach: Reach, traits: Traits) -> Iterator[tuple[Problem, Site]]:
    """Yield where the success of a leaf is waited for that runs until it is halted, with the node that is waited for."""
    found: set[Site] = set()
    for site in root.walk():
        for child, why in _waited(site, reach):
            leaf = next((one for one in child.walk() if traits.endless(one)), None)
            if leaf is not None and leaf not in found and S not in reach.ends(child):
                found.add(leaf)
                yield _in_vain(leaf, why), child
    if not found and S not in reach.ends(root):
        leaf = next((one for one in root.walk() if traits.endless(one)), None)
        if leaf is not None:
            yield _in_vain(leaf, "the tree never succeeds"), root


def _waited(site: Site, reach: Reach) -> Iterator[tuple[Site, str]]:
    """Yield the children whose success a node waits for, with what that keeps from coming."""
    if IN_TURN.get(site.kind) == S:
        for child, following in pairwise(site.children):
            yield child, f"'{following.name}' after it is never reached"
    elif site.kind == "Repeat":
        yield site.children[0], f"'{site.name}' never repeats it"
    elif is_parallel(site) and S not in reach.ends(site):
        yield from ((child, f"'{site.name}' waits for the success of {needed(site)} of its children") for child in site.children)


def _in_vain(leaf: Site, why: str) -> Problem:
    message = f"'{leaf.name}' runs until it is interrupted and never succeeds: {why}"
    cure = "put it into a Parallel beside what it accompanies, and let success_count not count it"
    return of_element("ALU612", leaf.element, message, cure)


def never_reached(child: Site, waits_for: Site, reach: Reach) -> Problem:
    """Return the problem of a child that is never ticked."""
    ends = " or ".join(sorted(reach.ends(waits_for))) or "runs for ever"
    message = f"'{child.name}' is never reached: '{waits_for.name}' before it always {ends}"
    return of_element("ALU610", child.element, message, "take it away, or put it where it is reached")


def several_run(root: Site, reach: Reach) -> Iterator[Problem]:
    """Yield where a reactive node has two children that may take several ticks: BehaviorTree.CPP ends the tree then."""
    for site in root.walk():
        if site.kind not in REACTIVE:
            continue
        running = [(child, runs) for child in site.children if (runs := reach.runs(child)) is not False]
        for child, runs in running[1:2]:
            sure = bool(runs and running[0][1])
            message = (
                f"'{child.name}' in a {site.kind} {'takes' if sure else 'may take'} several ticks, as '{running[0][0].name}' before it"
            )
            cure = "one child of it may; put the two into a Sequence, or ask a condition instead of the first"
            yield of_element("ALU611", child.element, message, cure, warning=not sure)


def is_parallel(site: Site) -> bool:
    """Tell whether a node ticks several children at once."""
    return site.kind in {"Parallel", "ParallelAll"} and site.type is not None and site.type.category is Category.CONTROL
