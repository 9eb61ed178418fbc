"""Random trees are ticked exactly as BehaviorTree.CPP itself ticks them (behaviortreepy: version 4.8.2).

What differs on purpose is in docs/concepts/trees.md and in test_trees_nodes.py.
"""

from __future__ import annotations

from collections import Counter

import pytest

pytest.importorskip("behaviortreepy")

from oracle import RAISED, Theirs, ours
from random_trees import make_case

pytestmark = pytest.mark.long
COUNT = 20_000
BATCH = 500
TICKS = 10


@pytest.mark.parametrize("first", range(0, COUNT, 5000))
def test_random_trees_tick_as_the_field_ticks_them(first):
    """Equal tick by tick: the root's answer, and the starts, ticks and halts of all leaves in their order."""
    roots: Counter[str] = Counter()
    for begin in range(first, first + 5000, BATCH):
        theirs = Theirs()
        for seed in range(begin, begin + BATCH):
            text, answers, halts = make_case(seed)
            expected, story = theirs.play(text, answers, TICKS, halts), ours(text, answers, TICKS, halts)
            assert story.ticks == expected.ticks, (seed, text, answers, halts, expected.error, story.error)
            roots.update(root for root, _ in expected.ticks)
    assert min(roots[root] for root in ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED", RAISED)) > 100  # it asks for all of them


def test_the_comparison_sees_a_difference():
    """A tree that is ticked otherwise is not equal: another answer, and another order of halts."""
    text = '<root BTCPP_format="4"><BehaviorTree ID="m"><{0}><Act name="a"/><Act name="b"/></{0}></BehaviorTree></root>'
    answers = {"a": ["SUCCESS"], "b": ["RUNNING"]}
    expected = Theirs().play(text.replace("{0}", "Sequence"), answers, 3, [2])
    assert ours(text.replace("{0}", "Sequence"), answers, 3, [2]).ticks == expected.ticks
    assert ours(text.replace("{0}", "ReactiveSequence"), answers, 3, [2]).ticks != expected.ticks
    assert ours(text.replace("{0}", "Sequence"), answers, 3, []).ticks != expected.ticks
