"""Ports that are empty, missing, or name entries that nobody writes: as BehaviorTree.CPP treats them, and what a check says of them."""

from __future__ import annotations

import pytest

from alula.check.checking import check
from alula.trees.errors import FileError
from alula.trees.factory import make_tree
from alula.trees.node import SyncAction
from alula.trees.node_type import Category, node_type
from alula.trees.ports import Direction, Port, inout_port
from alula.trees.reading import read_text
from alula.trees.registry import NodeRegistry
from alula.trees.standard import standard_registry
from alula.trees.status import SUCCESS

ROOT = '<root BTCPP_format="4"><BehaviorTree ID="m">{}</BehaviorTree></root>'
TICKED = (
    '<LoopString queue="a;b" value=""><Act name="a"/></LoopString>',
    '<LoopString queue="a;b"><Act name="a"/></LoopString>',
    '<LoopInt queue="1;2;" value=""><Act name="a"/></LoopInt>',
    '<LoopInt queue="" value="{x}"><Act name="a"/></LoopInt>',
    '<LoopString queue="{q}" value="{x}"><Act name="a"/></LoopString>',
    '<LoopInt queue="{q}" value="{x}" if_empty="FAILURE"><Act name="a"/></LoopInt>',
    '<LoopString value="{x}"><Act name="a"/></LoopString>',
    '<Sequence><Script code="q := \'1;2\'"/><LoopInt queue="{q}" value="{x}"><Act name="a"/></LoopInt></Sequence>',
    '<Sequence><SetBlackboard value="1;2" output_key="q"/><LoopString queue="{q}" value=""><Act name="a"/></LoopInt></Sequence>',
    '<Sequence><Script code=""/><Act name="a"/></Sequence>',
    '<Sequence><Script code=" "/><Act name="a"/></Sequence>',
    '<Sequence><ScriptCondition code=""/><Act name="a"/></Sequence>',
    '<Sequence><Script/><Act name="a"/></Sequence>',
    '<AlwaysSuccess _onSuccess=""/>',
)


@pytest.mark.parametrize("node", TICKED)
def test_empty_ports_are_ticked_as_the_field_ticks_them(node):
    oracle = pytest.importorskip("oracle")
    text, answers = ROOT.format(node), {"a": ["SUCCESS"]}
    expected, story = oracle.Theirs().play(text, answers, 5, []), oracle.ours(text, answers, 5, [])
    assert story.ticks == expected.ticks, (expected.error, story.error)


class Counts(SyncAction):
    """Counts in an entry."""

    ports = (inout_port("count"),)

    def update(self):
        """Count."""
        return SUCCESS


def found(node, *types):
    registry = standard_registry() | NodeRegistry(types)
    registry.register(Counts)
    return [(one.code, one.warning) for one in check(read_text(ROOT.format(node)), registry)]


def test_an_empty_output_and_an_empty_script_are_no_findings():
    assert found('<LoopString queue="a;b" value=""><AlwaysSuccess/></LoopString>') == []
    assert found('<Script code=""/>') == []
    assert found('<ScriptCondition code=""/>') == [("ALU614", False)]


def test_a_loop_needs_a_queue_that_somebody_writes():
    assert found('<LoopInt value="{i}"><AlwaysSuccess/></LoopInt>') == [("ALU604", False)]
    assert found('<LoopInt queue="{q}" value="{i}"><AlwaysSuccess/></LoopInt>') == [("ALU607", False)]
    written = '<Sequence><Script code="q := \'1;2\'"/><LoopInt queue="{q}" value="{i}"><AlwaysSuccess/></LoopInt></Sequence>'
    assert found(written) == [("ALU624", True)]  # nothing reads `i`


def test_a_port_that_is_read_and_written_is_read_first():
    assert found("<Counts/>") == [("ALU604", False)]
    assert found('<Counts count="{n}"/>') == [("ALU607", False)]
    assert found('<Sequence><Script code="n := 1"/><Counts count="{n}"/></Sequence>') == []
    assert found('<SetBlackboard value="1" output_key="{n}"/>') == [("ALU607", False)]


def test_of_a_port_that_only_a_model_tells_of_nobody_knows_whether_it_is_read_first():
    theirs = node_type("Theirs", Category.ACTION, [Port("count", direction=Direction.INOUT)])
    assert found("<Theirs/>", theirs) == found('<Theirs count="{n}"/>', theirs) == []


def test_a_copy_of_an_entry_that_was_written_as_text_is_made():
    """BehaviorTree.CPP 4.8 fails in the first tick, and raises in the next (docs/concepts/trees.md)."""
    copy = '<Sequence><SetBlackboard value="7" output_key="a"/><SetBlackboard value="{a}" output_key="b"/></Sequence>'
    tree = make_tree(read_text(ROOT.format(copy)), standard_registry(), lambda: 0)
    assert [tree.tick() for _ in range(2)] == [SUCCESS, SUCCESS]
    assert tree.subtrees[0].blackboard.get("b") == "7"


def test_an_output_that_is_a_plain_text_is_refused():
    """BehaviorTree.CPP writes nothing then: an entry without its braces is a slip (docs/concepts/trees.md)."""
    with pytest.raises(FileError, match="names an entry"):
        make_tree(read_text(ROOT.format('<LoopInt queue="1" value="x"><AlwaysSuccess/></LoopInt>')), standard_registry(), lambda: 0)


UNSET = '<Sequence><Script code="a := 1"/>{}<Script code="b := a"/></Sequence>'
TAKEN = '<UnsetBlackboard key="a"/>'


@pytest.mark.parametrize(
    ("between", "wrong"),
    [
        (TAKEN, True),
        (f'{TAKEN}<Script code="a := 2"/>', False),
        ('<UnsetBlackboard key="a" _skipIf="a == 1"/>', False),
        ('<UnsetBlackboard key="c"/>', False),
        (f"<ForceSuccess><Fallback><ScriptCondition code='a == 1'/>{TAKEN}</Fallback></ForceSuccess>", False),
        (f"<Sequence>{TAKEN}<Script code='c := a'/></Sequence>", True),
        (f"<Sequence>{TAKEN}<AlwaysSuccess/></Sequence>", False),  # what follows is judged within the sequence
    ],
)
def test_an_entry_that_was_taken_away_is_not_read(between, wrong):
    problems = check(read_text(ROOT.format(UNSET.format(between))), standard_registry())
    told = [one.message for one in problems if one.code != "ALU624"]  # `b` is never read
    assert ["UnsetBlackboard in line 1 has taken it away" in one for one in told] == [True] * wrong


INNER = """
<root BTCPP_format="4" main_tree_to_execute="m">
  <BehaviorTree ID="m"><SubTree ID="inner"{}/></BehaviorTree>
  <BehaviorTree ID="inner"><ScriptCondition code="height == 3"/></BehaviorTree>
  <TreeNodesModel><SubTree ID="inner"><input_port name="height"{}/></SubTree></TreeNodesModel>
</root>"""


@pytest.mark.parametrize(("use", "default"), [("", ' default="3"'), (' height="3"', ""), (' height="3" _autoremap="true"', "")])
def test_what_a_subtree_is_given_as_plain_text_is_written(use, default):
    text = INNER.format(use, default)
    assert [one.code for one in check(read_text(text), standard_registry())] == []
    assert make_tree(read_text(text), standard_registry(), int).tick() is SUCCESS
    oracle = pytest.importorskip("oracle")
    assert oracle.Theirs().play(text, {}, 1, []).ticks == oracle.ours(text, {}, 1, []).ticks


def test_a_condition_that_says_what_is_written_is_read_and_what_is_written_is_not():
    either = "<Sequence><Script code=\"a := 1; b := ''\"/><Script code=\"a == 1 ? b := 'x' : b := ''\"/></Sequence>"
    (told,) = check(read_text(ROOT.format(either).replace("<root", '<root main_tree_to_execute="m"')), standard_registry())
    assert (told.code, told.message) == ("ALU624", "`b` is written, and nothing reads it")
