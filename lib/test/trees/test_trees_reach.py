"""No child that BehaviorTree.CPP reaches is called unreachable, and what is never reached is found."""

from __future__ import annotations

from collections import Counter

import pytest
from random_trees import make_case

from alula.check.checking import check
from alula.check.reach import unreached
from alula.trees.configuration import configure
from alula.trees.ends import ANY_END, FAILS, SKIPS, SUCCEEDS
from alula.trees.node import Decorator, Shared
from alula.trees.nodes import leaves, sequences
from alula.trees.reach import Reach
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry
from alula.trees.status import ANSWERS, RUNNING, SKIPPED, SUCCESS

COUNT = 400
"""Trees in the suite; 20,000 were tried once."""
TICKS = 10
ROOT = '<root BTCPP_format="4"><BehaviorTree ID="m">{}</BehaviorTree></root>'
ACT = '<Action ID="Act"/>'


class Told(Reach):
    """The leaves' ends are those of the answers that they are going to give: so much is known of no other tree."""

    def __init__(self, answers):
        super().__init__()
        self._answers = answers

    def own_ends(self, config):
        given = self._answers.get(config.name)
        return super().own_ends(config) if given is None else frozenset(ANSWERS[answer] for answer in given) - {RUNNING}


def unreachable(text, registry, reach):
    """Return a file, and its elements that are never ticked wherever they stand, with all below them."""
    files = read_text(text)
    root = configure(files, registry, files.main, Shared(int))
    never = {one for child, _ in unreached(root, reach) for one in child.walk()}
    reached = {id(one.element) for one in root.walk() if one not in never}
    return files, {id(one.element) for one in root.walk()} - reached


def marked(files):
    """Have each node write on the root's blackboard that its turn has come: a script before all else that is asked before a tick."""
    elements = [one for tree in files.trees.values() for top in tree.children for one in top.iterate()]
    for number, element in enumerate(elements):
        name = "_failureIf" if "_failureIf" in element.attributes else "_successIf" if "_successIf" in element.attributes else "_skipIf"
        element.set(name, f"@reached{number} := 1; {element.get(name, 'false')}")
    return elements


def test_no_child_that_the_field_reaches_is_called_unreachable():
    oracle = pytest.importorskip("oracle")
    theirs, found = oracle.Theirs(), Counter()
    for seed in range(COUNT):
        text, answers, halts = make_case(seed)
        files, never = unreachable(text, oracle.PALETTE, Told(answers))
        elements = marked(files)
        names = theirs.play(files.documents[0].text(), answers, TICKS, halts).entries
        reached = {id(element) for number, element in enumerate(elements) if f"reached{number}" in names}
        assert not reached & never, (seed, text, answers, halts, [one.place for one in elements if id(one) in reached & never])
        found.update(reached=len(reached), never=len(never))
    assert found["reached"] > 5 * COUNT  # the marks are there
    assert found["never"] > COUNT / 4  # and something is called unreachable


def codes(node, registry=None):
    """Return what is found, but for entries that nothing reads, which these trees write to have conditions."""
    found = check(read_text(ROOT.format(node)), registry or standard_registry())
    return [one.code for one in found if one.code != "ALU624"]


REACHED = (
    '<Fallback><LoopInt queue="1;2" value="{i}" if_empty="FAILURE"><AlwaysSuccess/></LoopInt><AlwaysSuccess/></Fallback>',
    '<Sequence><LoopInt queue="1" value="{i}"><AlwaysFailure/></LoopInt><AlwaysSuccess/></Sequence>',
    '<Sequence><Script code="n := 0"/><Repeat num_cycles="{n}"><AlwaysFailure/></Repeat><AlwaysSuccess/></Sequence>',
    '<Fallback><RetryUntilSuccessful num_attempts="0"><AlwaysSuccess/></RetryUntilSuccessful><AlwaysSuccess/></Fallback>',
    '<Sequence><Repeat num_cycles="-2"><AlwaysFailure/></Repeat><AlwaysSuccess/></Sequence>',
    '<Sequence><Script code="e := 1"/><Fallback><Precondition if="false" else="{e}"><AlwaysSuccess/></Precondition>'
    "<AlwaysSuccess/></Fallback></Sequence>",
    '<Fallback><Parallel failure_count="2"><AlwaysFailure/><AlwaysSuccess/></Parallel><AlwaysSuccess/></Fallback>',
)


@pytest.mark.parametrize("node", REACHED)
def test_what_is_reached_is_no_finding(node):
    assert "ALU610" not in codes(node)


def test_what_is_never_reached_is_found():
    assert codes("<Sequence><AlwaysFailure/><AlwaysSuccess/></Sequence>") == ["ALU610"]
    loop = '<Sequence><LoopInt queue="1" value="{i}" if_empty="FAILURE"><AlwaysSuccess/></LoopInt><AlwaysSuccess/></Sequence>'
    assert codes(loop) == ["ALU610"]


def test_a_class_that_answers_otherwise_than_the_one_that_it_derives_from_may_do_anything():
    """What is told of ends belongs to what answers."""

    class Mine(sequences.Sequence):
        """Succeeds."""

        def update(self):
            return SUCCESS

    class Slow(leaves.Sleep):
        """Is skipped."""

        def on_running(self):
            return SKIPPED

    class Named(sequences.Fallback):
        """Another name."""

    class Told(leaves.Sleep):
        """Says so."""

        ends = SKIPS

        def on_running(self):
            return SKIPPED

    class Own(Decorator):
        """Does anything."""

    assert [one.is_described() for one in (Mine, Slow, Named, Told, Own)] == [False, False, True, True, True]
    registry = standard_registry()
    for node in (Mine, Slow, Named, Own):
        registry.register(node)
    assert codes("<Sequence><Mine><AlwaysFailure/><AlwaysSuccess/></Mine><AlwaysSuccess/></Sequence>", registry) == []
    assert codes("<Fallback><Slow msec='1'/><AlwaysSuccess/></Fallback>", registry) == []
    assert codes("<Named><AlwaysSuccess/><AlwaysSuccess/></Named>", registry) == ["ALU610"]
    assert codes("<Fallback><Own><AlwaysSuccess/></Own><AlwaysSuccess/></Fallback>", registry) == []


def test_ends_that_a_parallel_may_have():
    parallel = standard_registry().get("Parallel").described
    given = {"success_count": "-1", "failure_count": "1"}.get
    assert parallel.may_end(given, [SUCCEEDS, SUCCEEDS | SKIPS]) == SUCCEEDS
    assert parallel.may_end(given, [SUCCEEDS, FAILS]) == FAILS
    assert parallel.may_end(given, [ANY_END, ANY_END]) == ANY_END


# --- several that run -------------------------------------------------------------------------------------------------

WRITTEN = "x := 0; y := 0; mode := 1; s := 'a'"
SLEEPS = '<Sleep msec="5"{}/><Sleep msec="5"{}/>'
TWO = f'<Sequence><Script code="{WRITTEN}"/><ReactiveSequence>{SLEEPS}</ReactiveSequence></Sequence>'
EXCLUDED = (
    (' _while="x"', ' _skipIf="x"'),
    (' _while="mode == 1"', ' _while="mode == 2"'),
    (' _while="x &lt; 3"', ' _skipIf="x &lt; 5"'),
    (" _while=\"s == 'a'\"", " _while=\"s == 'b' || s == 'c'\""),
    (' _while="!x &amp;&amp; y == 1"', ' _while="x"'),
    (' _skipIf="x != 0"', ' _while="x == 2"'),
)
TOGETHER = (
    ("", ""),
    (' _while="x"', ""),
    (' _while="x"', ' _while="y"'),
    (' _while="x"', ' _skipIf="y"'),
    (' _while="x &lt; 5"', ' _skipIf="x &lt; 3"'),
    (' _while="mode == 1"', ' _while="mode &lt; 2"'),
    (' _while="x + 1 == 2"', ' _while="x + 1 == 3"'),
    (' _while="x == y"', ' _while="x != y"'),
    (' _while="x == 1"', " _while=\"x == 'a'\""),
)


@pytest.mark.parametrize(("one", "other"), EXCLUDED)
def test_conditions_that_exclude_each_other_let_two_children_run(one, other):
    assert codes(TWO.format(one, other)) == codes(TWO.format(other, one)) == []


@pytest.mark.parametrize(("one", "other"), TOGETHER)
def test_two_children_that_may_run_are_a_warning(one, other):
    problems = check(read_text(TWO.format(one, other).join(ROOT.split("{}"))), standard_registry())
    (found,) = (one for one in problems if one.code != "ALU624")
    assert (found.code, found.warning) == ("ALU611", True)
