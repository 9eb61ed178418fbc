"""Missions of files: skills and resources as nodes that call a robot's clients."""

from __future__ import annotations

import pytest

pytest.importorskip("py_trees")

from alula.language.models import ModelFile, check_texts
from alula.missions.context import MissionContext
from alula.missions.environment import MissionEnvironment
from alula.missions.part import NO_PART
from alula.missions.pending import PendingInterrupts
from alula.missions.registry import mission_registry
from alula.missions.skills import Crew
from alula.model.execution_state import ExecutionState
from alula.runtime.handle import SkillHandle
from alula.trees.factory import make_tree
from alula.trees.reading import read_text
from alula.trees.status import FAILURE, RUNNING, SUCCESS

MODEL = """
skillset arm {
  resource hand { state { OPEN CLOSED } initial OPEN transition { extern OPEN -> CLOSED extern CLOSED -> OPEN } }
  skill grip {
    input { tries: int8 }
    output { force: float64 }
    success HELD {}
    failure DROPPED {}
  }
}
"""


class Arm:
    """A client whose executions end when a test says so."""

    skillset = "arm"
    ready = True

    def __init__(self):
        self.resources = {"hand": "OPEN"}
        self.started = []

    def start(self, skill, **inputs):
        self.started.append((SkillHandle(skill, "1"), inputs))
        return self.started[-1][0]


def tree_of(body, arm):
    (file,) = check_texts([ModelFile("arm.rl", MODEL)])
    assert [one for one in file.findings if one.severity.value == "error"] == []
    crew = Crew({"arm": arm}, MissionContext(clock_ns=int, pending=PendingInterrupts(int)))
    files = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="m">{body}</BehaviorTree></root>', "m.xml")
    return make_tree(files, mission_registry(file.skillsets, NO_PART, crew), int)


@pytest.mark.parametrize(("success", "result", "answer"), [("", "HELD", SUCCESS), ("", "DROPPED", FAILURE),
                                                          ('success="DROPPED"', "DROPPED", SUCCESS)])  # fmt: skip
def test_a_skill_ends_as_its_model_or_the_file_says_and_writes_outputs(success, result, answer):
    arm = Arm()
    tree = tree_of(f'<arm.grip tries="3" outcome="{{why}}" force="{{force}}" {success}/>', arm)
    assert tree.tick() is RUNNING
    ((handle, inputs),) = arm.started
    assert inputs == {"tries": 3}
    handle.end(ExecutionState.TERMINATED, result, "", {"force": 2.5})
    assert tree.tick() is answer
    board = tree.root.blackboard
    assert (board.get("why"), board.get("force")) == (result, 2.5)


@pytest.mark.parametrize(("end", "outcome"), [(None, "INTERRUPTED"), ("DROPPED", "DROPPED"), ("HELD", "HELD")])
def test_a_skill_that_is_halted_is_interrupted_unless_it_had_ended_since_the_last_tick(end, outcome):
    arm = Arm()
    tree = tree_of(
        '<ReactiveSequence><arm.hand state="OPEN"/><arm.grip tries="3" outcome="{why}" force="{force}"/></ReactiveSequence>', arm
    )
    tree.tick()
    ((handle, _),) = arm.started
    if end:
        handle.end(ExecutionState.TERMINATED, end, "", {"force": 2.5})
    arm.resources["hand"] = "CLOSED"
    assert tree.tick() is FAILURE
    board = tree.root.blackboard
    assert (board.get("why"), board.get("force")) == (outcome, 2.5 if end else None)
    if end is None:  # what comes of it later is not told: the tree has gone on
        handle.end(ExecutionState.TERMINATED, "HELD", "")
        tree.tick()
        assert board.get("why") == "INTERRUPTED"


def test_a_resource_is_a_condition():
    arm = Arm()
    tree = tree_of('<arm.hand state="CLOSED"/>', arm)
    assert tree.tick() is FAILURE
    arm.resources["hand"] = "CLOSED"
    assert tree.tick() is SUCCESS


def test_numbers_have_the_limits_of_their_types():
    with pytest.raises(Exception, match="'300' is no int8"):
        tree_of('<arm.grip tries="300"/>', Arm())


def test_what_is_no_resource_has_no_value_in_a_script():
    world = MissionEnvironment(
        {"arm": Arm()}, MissionContext(clock_ns=int, pending=PendingInterrupts(int)), frozenset({"arm.hand"}), frozenset()
    )
    assert [world.value(name) for name in ("arm.hand", "arm.level", "arm.level.value", "leg.hand")] == ["OPEN", None, None, None]


@pytest.mark.parametrize("waits", [False, True])
def test_after_a_halt_a_start_in_its_skillset_waits_and_in_another_one_where_the_file_says_so(waits):
    files = [ModelFile("arm.rl", MODEL), ModelFile("leg.rl", "skillset leg { skill walk { success THERE {} } }")]
    models = [one for file in check_texts(files) for one in file.skillsets]
    arm, leg = Arm(), Arm()
    leg.skillset = "leg"
    crew = Crew({"arm": arm, "leg": leg}, MissionContext(clock_ns=int, pending=PendingInterrupts(int)))
    halted = f'<arm.grip tries="1" {"halt_waits=" + chr(34) + "true" + chr(34) if waits else ""}/>'
    body = f'<Sequence><Parallel success_count="1">{halted}<AlwaysSuccess/></Parallel><leg.walk/><arm.grip tries="2"/></Sequence>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="m">{body}</BehaviorTree></root>'
    tree = make_tree(read_text(text, "m.xml"), mission_registry(models, NO_PART, crew), int)
    assert tree.tick() is RUNNING
    assert len(leg.started) == (0 if waits else 1)
    if not waits:
        leg.started[0][0].end(ExecutionState.TERMINATED, "THERE", "")
        assert tree.tick() is RUNNING
        assert [inputs for _, inputs in arm.started] == [{"tries": 1}]  # the second one waits for the end of the first
    arm.started[0][0].end(ExecutionState.INTERRUPTED, "", "")
    assert tree.tick() is RUNNING
    assert (len(leg.started), len(arm.started)) == ((1, 1) if waits else (1, 2))


def test_two_skills_that_fail_at_once_are_both_the_reason():
    arm = Arm()
    both = '<Parallel success_count="2" failure_count="1"><arm.grip name="a" tries="1"/><arm.grip name="b" tries="2"/></Parallel>'
    tree = tree_of(both, arm)
    tree.tick()
    for handle, _ in arm.started:
        handle.end(ExecutionState.TERMINATED, "DROPPED", "")
    assert tree.tick() is FAILURE
    context = tree.root.children[0].crew.context
    assert [failure.leaf for failure in context.failures] == ["a", "b"]
