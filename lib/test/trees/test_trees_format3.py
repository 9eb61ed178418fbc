"""Files of BehaviorTree.CPP 3: recognised, read by their rules, and converted with all else as it was."""

from pathlib import Path

import pytest
from behaviortreepy import BehaviorTreeFactory

from alula.cli.tree import main
from alula.trees.errors import Problem
from alula.trees.factory import make_tree
from alula.trees.reading import read_text
from alula.trees.standard import standard_registry
from alula.trees.status import FAILURE, RUNNING, SUCCESS, Answer

TREES = '<BehaviorTree ID="Main">{}</BehaviorTree><BehaviorTree ID="Leg"><AlwaysSuccess/></BehaviorTree>'
OLD = """<?xml version="1.0"?>
<root main_tree_to_execute = "Main">
  <!-- the whole -->
  <BehaviorTree ID="Main">
    <SequenceStar name="all">
      <SetBlackboard output_key="place" value="dock" />
      <SubTree   ID="Leg" target="place"/>
      <SubTreePlus ID="Leg" target="{place}" speed="fast" __autoremap="1" />
      <SubTree ID="Leg"><remap internal="target" external="place"/></SubTree>
      <Parallel success_threshold="1" failure_threshold="2">
        <AlwaysSuccess/>
        <AlwaysFailure/>
      </Parallel>
      <BlackboardCheckString value_A="{place}" value_B="dock" return_on_mismatch="FAILURE">
        <AlwaysSuccess/>
      </BlackboardCheckString>
    </SequenceStar>
  </BehaviorTree>
  <BehaviorTree ID="Leg">
    <BlackboardCheckString value_A="{target}" value_B="sea" return_on_mismatch="SUCCESS"><AlwaysFailure/></BlackboardCheckString>
  </BehaviorTree>
  <TreeNodesModel>
    <SubTreePlus ID="Leg"><input_port name="target"/></SubTreePlus>
  </TreeNodesModel>
</root>
"""
NEW = """<?xml version="1.0"?>
<root main_tree_to_execute = "Main" BTCPP_format="4">
  <!-- the whole -->
  <BehaviorTree ID="Main">
    <SequenceWithMemory name="all">
      <SetBlackboard output_key="place" value="dock" />
      <SubTree   ID="Leg" target="{place}"/>
      <SubTree ID="Leg" target="{place}" speed="fast" _autoremap="1" />
      <SubTree ID="Leg" target="{place}"/>
      <Parallel success_count="1" failure_count="2">
        <AlwaysSuccess/>
        <AlwaysFailure/>
      </Parallel>
      <ReactiveSequence>
        <ScriptCondition code="place == 'dock'"/>
        <AlwaysSuccess/>
      </ReactiveSequence>
    </SequenceWithMemory>
  </BehaviorTree>
  <BehaviorTree ID="Leg">
    <ReactiveFallback><Inverter><ScriptCondition code="target == 'sea'"/></Inverter><AlwaysFailure/></ReactiveFallback>
  </BehaviorTree>
  <TreeNodesModel>
    <SubTree ID="Leg"><input_port name="target"/></SubTree>
  </TreeNodesModel>
</root>
"""


def test_a_file_is_converted_with_all_else_as_it_was(tmp_path, capsys):
    old, new = tmp_path / "old.xml", tmp_path / "new.xml"
    old.write_text(OLD)
    assert main([str(old), "--to", "4", "--out", str(new)]) == 0
    out, err = capsys.readouterr()
    assert (out, new.read_text()) == ("", NEW)
    assert [line.partition(": ")[0] for line in err.splitlines()] == [f"{old}:14:7", f"{old}:20:5"]
    assert "fails in the tick where an entry is not written yet" in err
    assert main([str(new), "--to", "4"]) == 2
    assert capsys.readouterr().err == f"alula tree: {new}: is no file of BehaviorTree.CPP 3; there is nothing to convert\n"
    assert main([str(old), "--out", str(new)]) == 2


def test_a_file_is_read_as_its_conversion_and_told_once():
    problems: list[Problem] = []
    read_text(OLD, "f.xml", problems.append)
    (told,) = problems
    assert (told.code, told.warning, told.place.line) == ("ALU623", True, 5)
    assert told.message.startswith(
        "is of BehaviorTree.CPP 3, as <SequenceStar> shows, and is read by its rules, but for what a person has to decide (2)"
    )
    assert ticked(OLD) is SUCCESS
    assert ticked(OLD.replace('"dock" />', '"sea" />')) is FAILURE


def ticked(text: str) -> Answer:
    tree = make_tree(read_text(text), standard_registry(), lambda: 0)
    while tree.tick() is RUNNING:
        pass
    return tree.answer


def test_the_conversion_is_what_behaviortree_cpp_4_ticks_so():
    for place, answer in (("dock", "SUCCESS"), ("sea", "FAILURE")):
        factory = BehaviorTreeFactory()
        factory.register_behavior_tree_from_text(NEW.replace('value="dock"', f'value="{place}"'))
        assert factory.create_tree("Main").tick_while_running().name == answer


@pytest.mark.parametrize(
    ("node", "shown"),
    [
        ('<SubTreePlus ID="Leg"/>', "<SubTreePlus>"),
        ('<SubTree ID="Leg" __shared_blackboard="true"/>', '__shared_blackboard="true"'),
        ('<Parallel failure_threshold="1"><AlwaysSuccess/></Parallel>', 'failure_threshold="1"'),
        ('<RetryUntilSuccesful num_attempts="2"><AlwaysSuccess/></RetryUntilSuccesful>', "<RetryUntilSuccesful>"),
        ('<SubTree ID="Leg" target="goal"/>', 'target="goal"'),
    ],
)
def test_marks_of_format_3(node, shown):
    problems: list[Problem] = []
    read_text(f"<root main_tree_to_execute='Main'>{TREES.format(node)}</root>", report=problems.append)
    assert f"as {shown} shows" in problems[0].message
    problems.clear()
    read_text(f'<root BTCPP_format="4" main_tree_to_execute="Main">{TREES.format(node)}</root>', report=problems.append)
    assert not problems


@pytest.mark.parametrize(
    "node", ['<SubTree ID="Leg" speed="2.0"/>', '<SubTree ID="Leg" fast="true"/>', '<SubTree ID="Leg" a="b" c="{d}"/>', "<AlwaysSuccess/>"]
)
def test_without_marks_format_4_is_taken(node):
    problems: list[Problem] = []
    read_text(f"<root main_tree_to_execute='Main'>{TREES.format(node)}</root>", report=problems.append)
    assert [one.message for one in problems] == ["<root> has no BTCPP_format: 4 is taken, as BehaviorTree.CPP does"]


@pytest.mark.parametrize(
    ("node", "told"),
    [
        ('<SubTree ID="Leg" __shared_blackboard="true"/>', "with _autoremap it shares all but those whose names begin with `_`"),
        ('<SubTree ID="Leg" a="{b}"/>', "now it is the entry `b`"),
        ('<SubTree ID="Leg" a="1;2"/>', "now the text is what the subtree gets"),
        (
            '<BlackboardCheckInt value_A="{a}" value_B="1" return_on_mismatch=""><AlwaysSuccess/></BlackboardCheckInt>',
            "no counterpart",
        ),
    ],
)
def test_what_a_person_has_to_decide_is_told(node, told, tmp_path: Path, capsys):
    path = tmp_path / "old.xml"
    path.write_text(f'<root BTCPP_format="3" main_tree_to_execute="Main">{TREES.format(node)}</root>')
    assert main([str(path), "--to", "4"]) == 0
    out, err = capsys.readouterr()
    assert told in err
    assert out.startswith('<root BTCPP_format="4" main')
