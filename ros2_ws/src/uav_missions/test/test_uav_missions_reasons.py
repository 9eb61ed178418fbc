"""What took the vehicle from the mission is told at the end: the pilot, a failsafe, or a lost link."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from uav_missions_fakes import World, make_memory

from alula.missions.blackboard import Failure
from alula.model.execution_state import ExecutionState
from uav_missions.reasons import AuthorityReasons, note_health

LOST = Failure("fly", "navigation.goto", ExecutionState.RESOURCE_INVARIANT_VIOLATED, "keep_sdk_authority", "")


def state(**changes: object) -> SimpleNamespace:
    return SimpleNamespace(**{"authority": False, "link": True, "mode": "LOITER", "landed_state": 2, "ready": True, **changes})


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (state(), "the vehicle is in LOITER: the pilot or a failsafe has it"),
        (state(link=False, mode="GUIDED"), "the link to the autopilot is lost"),
        (state(landed_state=1, ready=False, mode="STABILIZE"), "the vehicle stands in STABILIZE, its own checks are not passed"),
    ],
)
def test_a_lost_authority_is_told_with_its_cause_also_when_it_comes_back(told, words):
    blackboard = make_memory(World())
    authority = AuthorityReasons(blackboard)
    authority.note(told)
    authority.note(state(authority=True))
    blackboard.failures.append(LOST)
    blackboard.note_reason()
    assert blackboard.explained() == f"navigation.goto: RESOURCE_INVARIANT_VIOLATED keep_sdk_authority ({words})"


def test_the_cause_of_a_lost_authority_stays_told_after_a_landing():
    blackboard = make_memory(World())
    authority = AuthorityReasons(blackboard)
    blackboard.failures.append(LOST)
    blackboard.note_reason()
    for told in (state(landed_state=1, authority=True), state(authority=True), state(), state(authority=True)):
        authority.note(told)
    authority.note(state(landed_state=1, authority=True, mode="LAND"))
    assert blackboard.explained().endswith("keep_sdk_authority (the vehicle is in LOITER: the pilot or a failsafe has it)")


def test_an_autopilot_that_restarts_leaves_the_guidance_in_command():
    blackboard = make_memory(World())
    authority = AuthorityReasons(blackboard)
    authority.note(state(landed_state=1, ready=False, mode="STABILIZE"))
    authority.note(state(landed_state=1, authority=True, mode="GUIDED"))
    authority.note(state(authority=True, mode="GUIDED"))
    blackboard.failures.append(LOST)
    blackboard.note_reason()
    assert blackboard.explained().endswith("keep_sdk_authority (the autopilot has restarted)")


@pytest.mark.parametrize("silent", [False, True])
def test_an_autopilot_that_restarts_in_the_air_is_not_told_as_one_that_stands(silent):
    blackboard = make_memory(World())
    authority = AuthorityReasons(blackboard)
    authority.note(state(landed_state=1, authority=True, mode="GUIDED"))
    authority.note(state(authority=True, mode="GUIDED"))
    if silent:
        authority.note(state(link=False, mode="GUIDED"))
    authority.note(state(landed_state=1, ready=False, mode="STABILIZE"))
    blackboard.failures.append(LOST)
    blackboard.note_reason()
    assert blackboard.explained().endswith("keep_sdk_authority (the autopilot has restarted)")


@pytest.mark.parametrize("pilot", [False, True])
def test_after_a_landing_a_vehicle_that_stands_is_told_as_one(pilot):
    blackboard = make_memory(World())
    authority = AuthorityReasons(blackboard)
    authority.note(state(authority=True, mode="GUIDED"))
    authority.note(state(landed_state=1, authority=not pilot, mode="LAND"))
    authority.note(state(landed_state=1, ready=False, mode="STABILIZE"))
    blackboard.failures.append(LOST)
    blackboard.note_reason()
    assert blackboard.explained().endswith("(the vehicle stands in STABILIZE, its own checks are not passed)")


def test_other_failures_are_told_without_it():
    blackboard = make_memory(World())
    AuthorityReasons(blackboard).note(state())
    note_health(blackboard, "perception.zed_status", SimpleNamespace(reason="no images"))
    blackboard.failures.append(Failure("watch", "perception.zed_depthmap", ExecutionState.TERMINATED, "LOST", ""))
    blackboard.note_reason()
    assert blackboard.explained() == "perception.zed_depthmap: LOST"
    assert blackboard.because("perception.zed_status") == ": no images"
    assert blackboard.because("perception.lidar_status") == ""
