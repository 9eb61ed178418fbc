"""What missions are made of, node by node, on a clock that the test moves; whole trees are flown in ``uav_missions``."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

pytest.importorskip("py_trees")

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from alula.missions.context import Failure, MissionContext
from alula.missions.leaves import SkillLeaf
from alula.missions.pending import PendingInterrupts
from alula.model.execution_state import ExecutionState
from alula.runtime.handle import SkillHandle

E = ExecutionState
S, F, R = Status.SUCCESS, Status.FAILURE, Status.RUNNING


@dataclass
class Client:
    """Its handles end when the test says so."""

    skillset: str = "arm"
    ready: bool = True
    resources: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    started: list[tuple[str, dict, SkillHandle]] = field(default_factory=list)
    interrupts: list[str] = field(default_factory=list)

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        handle = SkillHandle(skill, str(len(self.started)), lambda: self.interrupts.append(skill))
        self.started.append((skill, inputs, handle))
        return handle


class Clock:
    def __init__(self) -> None:
        self.s = 0.0
        self.board = MissionContext(clock_ns=self.ns, pending=PendingInterrupts(self.ns, bound_s=5.0))

    def ns(self) -> int:
        return round(self.s * 1e9)


def ticked(node: Behaviour) -> Status:
    node.tick_once()
    return node.status


@pytest.fixture
def clock():
    return Clock()


def leaf(clock, client, skill="grip", inputs=None, **options):
    return SkillLeaf(skill, client, skill, {} if inputs is None else inputs, context=clock.board, **options)


def test_a_skill_is_started_once_with_inputs_of_that_moment_and_succeeds_by_its_result(clock):
    client, done = Client(), []
    grip = leaf(clock, client, inputs=lambda board: {"at_s": board.now_s}, success=["HELD"], on_success=done.append)
    clock.s = 3.0
    assert [ticked(grip), ticked(grip)] == [R, R]
    ((skill, inputs, execution),) = client.started
    assert (skill, inputs) == ("grip", {"at_s": 3.0})
    execution.end(E.TERMINATED, "HELD", "")
    assert ticked(grip) is S
    assert (done, clock.board.failures, grip.feedback_message) == ([clock.board], [], "HELD")
    assert ticked(grip) is R  # a leaf that is ticked again asks again
    assert len(client.started) == 2


@pytest.mark.parametrize(
    ("end", "sentence"),
    [
        ((E.TERMINATED, "DROPPED", "slippery"), "arm.grip: DROPPED (slippery)"),
        ((E.NOT_READY, "arm_free", "arm_free: arm is BUSY"), "arm.grip: NOT_READY arm_free (arm is BUSY)"),
        ((E.FAILED, "", "the managers have gone"), "arm.grip: FAILED (the managers have gone)"),
        ((E.INTERRUPTED, "", ""), "arm.grip: INTERRUPTED"),
    ],
)
def test_any_other_end_is_a_failure_that_says_why(clock, end, sentence):
    client = Client()
    grip = leaf(clock, client, success=["HELD"])
    ticked(grip)
    client.started[0][2].end(*end)
    assert ticked(grip) is F
    assert grip.feedback_message == sentence
    assert [failure.sentence() for failure in clock.board.failures] == [sentence]


def test_a_leaf_that_is_left_interrupts_once_and_the_next_start_in_its_skillset_waits_but_not_for_ever(clock):
    client, other = Client(), Client("legs")
    grip, lift, walk = leaf(clock, client), leaf(clock, client, "lift"), leaf(clock, other, "walk")
    ticked(grip)
    for _ in range(3):
        grip.stop(Status.INVALID)
    assert client.interrupts == ["grip"]
    assert [ticked(lift), ticked(walk)] == [R, R]
    assert ([skill for skill, _, _ in client.started], [skill for skill, _, _ in other.started]) == (["grip"], ["walk"])
    assert lift.feedback_message == "waits for the end of arm.grip"
    clock.s = 4.9
    ticked(lift)
    assert len(client.started) == 1
    clock.s = 5.1  # it has been waited for long enough: the managers have the last word
    ticked(lift)
    assert [skill for skill, _, _ in client.started] == ["grip", "lift"]


def test_the_reason_names_each_failure_once_and_nothing_that_fails_afterwards(clock):
    first, second = Failure("a", "arm.grip", E.FAILED, "", "cold"), Failure("b", "arm.lift", E.TERMINATED, "STUCK", "")
    clock.board.failures += [first, first, second]
    clock.board.note_reason()
    clock.board.failures.append(Failure("c", "arm.rest", E.FAILED, "", ""))
    assert clock.board.reason == "arm.grip: FAILED (cold); then arm.lift: STUCK"


def test_what_no_skill_tells_is_noted_once_behind_what_the_skills_told(clock):
    clock.board.failures.append(Failure("watch", "perception.zed", E.TERMINATED, "LOST", ""))
    for _ in range(2):
        clock.board.note("the barometer drifted")
    clock.board.note_reason()
    assert clock.board.reason == "perception.zed: LOST; then the barometer drifted"
