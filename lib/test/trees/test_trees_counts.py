"""Counts of nodes, in the file and in entries, mean what they mean to BehaviorTree.CPP (behaviortreepy: version 4.8.2)."""

from __future__ import annotations

from itertools import product

import pytest

pytest.importorskip("behaviortreepy")

from oracle import Theirs, ours

COUNTS = (-2147483648, -3, -2, -1, 0, 1, 2, 3, 4)
TEXTS = ("", "two", "2147483648", "-2147483649")
TICKS = 7
ANSWERS = (
    ["SUCCESS"],
    ["FAILURE"],
    ["RUNNING", "FAILURE", "SUCCESS"],
    ["FAILURE", "SUCCESS", "RUNNING"],
    ["SKIPPED", "FAILURE", "SUCCESS"],
)
ONE, THREE = '<Act name="a"/>', '<Act name="a"/><Act name="b"/><Act name="a"/>'
NODES = {
    "Repeat num_cycles": ONE,
    "RetryUntilSuccessful num_attempts": ONE,
    "Parallel success_count": THREE,
    "Parallel failure_count": THREE,
    "ParallelAll max_failures": THREE,
    "Timeout msec": ONE,
    "Delay delay_msec": ONE,
    "Sleep msec": "",
}
WAITS = {"Timeout msec": 0, "Sleep msec": 0, "Delay delay_msec": -1}
"""With the least count that is tried beside -2 and -1: the clock of the other engine is the wall clock, of another thread in a Delay."""
NEVER_MS = 1_000_000
HALTS = {"Sleep msec": []}
"""At which ticks the tree is halted, where not at the fifth: a Sleep there hears of it in a thread, perhaps after it has begun anew."""


def tree(node: str, count: object, *, by_entry: bool) -> str:
    tag, port = node.split()
    value, body = ("{n}" if by_entry else count), NODES[node]
    text = f'<{tag} {port}="{value}">{body}</{tag}>'
    if by_entry:
        written = count if isinstance(count, int) else f"'{count}'"
        text = f'<Sequence><Script code="n := {written}"/>{text}</Sequence>'
    return f'<root BTCPP_format="4"><BehaviorTree ID="m">{text}</BehaviorTree></root>'


@pytest.mark.parametrize("by_entry", [False, True])
@pytest.mark.parametrize("node", NODES)
def test_counts_mean_what_they_mean_to_the_field(node, by_entry):
    theirs = Theirs()
    counts = (-2, -1, WAITS[node], NEVER_MS) if node in WAITS else COUNTS
    for count, one, other in product((*counts, *TEXTS), ANSWERS, ANSWERS if NODES[node] == THREE else ANSWERS[:1]):
        text, answers = tree(node, count, by_entry=by_entry), {"a": one, "b": other}
        halts = HALTS.get(node, [5])
        expected, story = theirs.play(text, answers, TICKS, halts), ours(text, answers, TICKS, halts)
        assert story.ticks == expected.ticks, (text, answers, expected.error, story.error)
