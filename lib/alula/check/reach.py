"""Children that are never ticked, ends that are waited for in vain, nodes that take several ticks where only one may."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, pairwise

from alula.check.problems import of_element
from alula.trees.ends import whole_number
from alula.trees.errors import Problem
from alula.trees.node import NodeConfig
from alula.trees.nodes.parallel import threshold_of
from alula.trees.reach import Reach
from alula.trees.status import FAILURE, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import AGAIN, Order

_WORDS: dict[Answer, str] = {FAILURE: "fails", SKIPPED: "is skipped", SUCCESS: "succeeds"}


def needed(config: NodeConfig) -> int | None:
    """Return how many children of a node that ticks them at once have to succeed; None where that is known when it is ticked only."""
    port = config.ticking.succeeds_after
    count = whole_number(config.ports.get, port) if port else -1
    return None if count is None else threshold_of(count, len(config.children))


def unreached(root: NodeConfig, reach: Reach) -> Iterator[tuple[NodeConfig, NodeConfig]]:
    """Yield each child that is never ticked (of several in a row the first), with the one whose end is waited for in vain."""
    for config in root.walk():
        yield from reach.never_ticked(config)


def waits_in_vain(root: NodeConfig, reach: Reach) -> Iterator[tuple[Problem, NodeConfig]]:
    """Yield where the success of a leaf is waited for that runs until it is halted, with the node that is waited for."""
    found: set[NodeConfig] = set()
    for config in root.walk():
        for child, why in _waited(config, reach):
            leaf = reach.endless(child)
            if leaf is not None and leaf not in found and SUCCESS not in reach.ends(child):
                found.add(leaf)
                yield _in_vain(leaf, why), child
    if not found and SUCCESS not in reach.ends(root):
        leaf = reach.endless(root)
        if leaf is not None:
            yield _in_vain(leaf, "the tree never succeeds"), root


def _waited(config: NodeConfig, reach: Reach) -> Iterator[tuple[NodeConfig, str]]:
    """Yield the children whose success a node waits for, with what that keeps from coming."""
    ticking = config.ticking
    if ticking.lists and ticking.goes_on is SUCCESS:
        for child, following in pairwise(config.children):
            yield child, f"'{following.name}' after it is never reached"
    elif ticking.order is Order.SINGLE and {AGAIN, SUCCESS} <= ticking.follows(SUCCESS):
        yield config.children[0], f"'{config.name}' never repeats it"
    elif is_parallel(config) and SUCCESS not in reach.ends(config):
        yield from ((child, f"'{config.name}' waits for the success of {needed(config)} of its children") for child in config.children)


def _in_vain(leaf: NodeConfig, why: str) -> Problem:
    message = f"'{leaf.name}' runs until it is interrupted and never succeeds: {why}"
    cure = "put it into a Parallel beside what it accompanies, and let success_count not count it"
    return of_element("ALU612", leaf.element, message, cure)


def never_reached(child: NodeConfig, waits_for: NodeConfig, reach: Reach) -> Problem:
    """Return the problem of a child that is never ticked."""
    ends = " or ".join(word for end, word in _WORDS.items() if end in reach.ends(waits_for)) or "runs for ever"
    message = f"'{child.name}' is never reached: '{waits_for.name}' before it always {ends}"
    return of_element("ALU610", child.element, message, "take it away, or put it where it is reached")


def several_run(root: NodeConfig, reach: Reach, excluded: Callable[[NodeConfig, NodeConfig], bool]) -> Iterator[Problem]:
    """Yield where a reactive node has two children that may take several ticks: one that runs has the other halted."""
    for config in root.walk():
        if config.ticking.order is not Order.REACTIVE:
            continue
        running = [(child, runs) for child in config.children if (runs := reach.runs(child)) is not False]
        for one, other in combinations(running, 2):
            if excluded(one[0], other[0]):
                continue
            verb = "takes" if one[1] and other[1] else "may take"
            both = f"'{other[0].name}' in a {config.type.name} {verb} several ticks, as '{one[0].name}' before it"
            cure = "put the two into a Sequence, ask a condition instead of the first, or give them `_while` that exclude each other"
            yield of_element("ALU611", other[0].element, f"{both}: each may have the other halted", cure, warning=True)
            break


def is_parallel(config: NodeConfig) -> bool:
    """Return whether a node ticks several children at once."""
    return config.ticking.order is Order.AT_ONCE
