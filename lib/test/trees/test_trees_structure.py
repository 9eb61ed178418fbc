"""What is wrong in a tree before it is built: each finding, its place and its cure."""

from __future__ import annotations

import pytest
from trees_clock import Played, frame, registry

from alula.trees.errors import FileError, Problem
from alula.trees.factory import make_tree
from alula.trees.reading import read_text
from alula.trees.structure import verify

WRONG = {
    "<Sequenc/>": "1: unknown node 'Sequenc'; did you mean Sequence?",
    "<Action ID='Navigate'/>": "9: unknown node 'Navigate'; see `alula palette`",
    "<Action/>": "1: <Action> has no ID; it names the type of the node",
    "<Sequence/>": "1: 'Sequence' has no children; it takes 1 or more",
    "<Inverter><AlwaysSuccess/><AlwaysSuccess/></Inverter>": "27: 'Inverter' has 2 children; it takes 1: put them into a Sequence",
    "<Switch2 variable='1'><AlwaysSuccess/></Switch2>": "1: 'Switch2' has 1 child; it takes 3",
    "<AlwaysSuccess><AlwaysSuccess/></AlwaysSuccess>": "16: 'AlwaysSuccess' has 1 child; it takes none",
    "<IfThenElse><AlwaysSuccess/></IfThenElse>": "1: 'IfThenElse' has 1 child; it takes 2 to 3",
    "<Sleep mse='3'/>": "8: 'Sleep' has no port 'mse'; did you mean msec?",
    "<Sleep msec='-3'/>": "14: the port 'msec': '-3' is no unsigned int; write a whole number from 0 to 4294967295",
    "<Sleep msec='3s'/>": "14: the port 'msec': '3s' is no unsigned int; write a whole number from 0 to 4294967295",
    "<RunOnce then_skip='yes'><AlwaysSuccess/></RunOnce>": "21: the port 'then_skip': 'yes' is no bool; write true or false",
    "<LoopInt queue='1' value='x'><AlwaysSuccess/></LoopInt>": "20: the port 'value' is written; it names an entry: value=\"{...}\"",
    "<Sleep ID='x' msec='3'/>": '8: <Sleep> takes no ID; the tag is its type; call it by name="..."',
    "<main/>": "1: unknown node 'main'; it is a tree: write <SubTree ID=\"main\"/>",
    "<SubTree ID='man'/>": "10: there is no tree 'man'; did you mean main?",
    "<SubTree ID='main'/>": "1: a tree contains itself: 'main' in 'main'; write a loop with Repeat",
    "<ReactiveSequence><AsyncSequence><AlwaysSuccess/></AsyncSequence><AsyncSequence><AlwaysSuccess/></AsyncSequence></ReactiveSequence>": (
        "66: a second AsyncSequence in a ReactiveSequence; only one child may take several ticks"
    ),
    "<Script code='a := '/>": "20: a value was expected, not the end of the script; the script ends too early",
    "<AlwaysSuccess _skipIf='a =='/>": "29: a value was expected, not the end of the script; the script ends too early",
}


@pytest.mark.parametrize("body", WRONG)
def test_what_is_wrong_is_told_with_its_place_and_cure(body):
    with pytest.raises(FileError) as error:
        Played(body)
    place, _, told = str(error.value).partition(": ")
    column = int(place.rpartition(":")[2]) - len(frame("").partition("</")[0])
    assert f"{column}: {told}" == WRONG[body]


def test_an_entry_has_one_type():
    loops = "".join(f"<Loop{one} queue='1' value='{{x}}'><AlwaysSuccess/></Loop{one}>" for one in ("Int", "Bool"))
    with pytest.raises(FileError, match="the port 'value' is bool, and the entry 'x' is int elsewhere; use another entry"):
        Played(f"<Sequence>{loops}</Sequence>")


def test_all_that_is_wrong_is_reported_without_a_tree():
    problems: list[Problem] = []
    body = "<Sequence><Sequenc/><SubTree ID='b'><Foo/></SubTree><Sleep mse='1'/></Sequence>"
    verify(read_text(f"<root><BehaviorTree ID='Sequence'>{body}</BehaviorTree></root>"), registry(), problems.append)
    assert [problem.message for problem in problems] == [
        "there is no tree 'b'",
        "the tree 'Sequence' has the name of a node",
        "unknown node 'Sequenc'",
        "<SubTree> 'b' has children",
        "unknown node 'Foo'",
        "'Sleep' has no port 'mse'",
    ]


def test_trees_that_contain_one_another_are_found():
    trees = "".join(f"<BehaviorTree ID='{one}'><SubTree ID='{other}'/></BehaviorTree>" for one, other in ("ab", "bc", "ca"))
    with pytest.raises(FileError, match="a tree contains itself: 'a' in 'c' in 'b' in 'a'"):
        make_tree(read_text(f"<root main_tree_to_execute='a'>{trees}</root>"), registry(), lambda: 0)


def test_a_tree_that_grows_beyond_all_bounds_is_refused():
    """Sixteen trees, each with ten of the next: a file of 3 kB, 10^16 nodes."""
    trees = "".join(
        f"<BehaviorTree ID='t{n}'><Sequence>{f'<SubTree ID={chr(34)}t{n + 1}{chr(34)}/>' * 10}</Sequence></BehaviorTree>" for n in range(16)
    )
    text = f"<root main_tree_to_execute='t0'>{trees}<BehaviorTree ID='t16'><AlwaysSuccess/></BehaviorTree></root>"
    with pytest.raises(FileError, match="the tree 't11' has with its subtrees 222221 nodes, more than 65535"):
        make_tree(read_text(text), registry(), lambda: 0)


def test_the_deepest_tree_is_ticked_and_halted_and_a_deeper_one_is_refused():
    def chain(levels):
        trees = "".join(f"<BehaviorTree ID='t{n}'><SubTree ID='t{n + 1}'/></BehaviorTree>" for n in range(levels - 1))
        return f"<root main_tree_to_execute='t0'>{trees}<BehaviorTree ID='t{levels - 1}'><Sleep msec='9'/></BehaviorTree></root>"

    tree = make_tree(read_text(chain(256)), registry(), lambda: 0)
    assert tree.tick().name == "RUNNING"
    tree.halt()
    assert {node.status.name for node in tree.nodes} == {"INVALID"}
    with pytest.raises(FileError, match="the tree 't0' is with its subtrees 257 levels deep, more than 256"):
        make_tree(read_text(chain(257)), registry(), lambda: 0)


def test_a_subtree_has_what_its_model_gives_it():
    model = '<TreeNodesModel><SubTree ID="s"><input_port name="n" default="3"/><input_port name="m"/></SubTree></TreeNodesModel>'
    more = f'<BehaviorTree ID="s"><ScriptCondition code="n == 3 &amp;&amp; m == 4"/></BehaviorTree>{model}'
    assert Played('<SubTree ID="s" m="4"/>', more=more).tick() == "SUCCESS"
    assert Played('<SubTree ID="s" m="4" n="5"/>', more=more).tick() == "FAILURE"
    with pytest.raises(FileError, match="the subtree 's' needs the port 'm'"):
        Played('<SubTree ID="s"/>', more=more)
