"""Missions of files: skills and resources as nodes that call a robot's clients."""

from __future__ import annotations

import pytest

pytest.importorskip("py_trees")

from alula.language.models import ModelFile, check_texts
from alula.missions.blackboard import Blackboard
from alula.missions.filed.palette import mission_palette
from alula.missions.filed.part import NO_PART
from alula.missions.filed.skills import Crew
from alula.missions.filed.world import World
from alula.missions.pending import PendingInterrupts
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
    crew = Crew({"arm": arm}, Blackboard(clock_ns=int, pending=PendingInterrupts(int)))
    files = read_text(f'<root BTCPP_format="4"><BehaviorTree ID="m">{body}</BehaviorTree></root>', "m.xml")
    return make_tree(files, mission_palette(file.skillsets, NO_PART, crew), int)


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
    world = World({"arm": Arm()}, Blackboard(clock_ns=int, pending=PendingInterrupts(int)), frozenset({"arm.hand"}), frozenset())
    assert [world.value(name) for name in ("arm.hand", "arm.level", "arm.level.value", "leg.hand")] == ["OPEN", None, None, None]
