"""What follows from a fault: the change of a resource, the skill that failed because of it, and nothing that only came later."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from alula.campaign.plan import MOCKS, PlannedRun
from alula.campaign.rows import rows_of
from alula.common.faults import parse_fault
from alula.common.record import REPORTS, Entry
from alula.model.execution_state import ExecutionState as S
from alula.model.model import ResultKind
from alula.model.unmet import Unmet
from alula.records.causes.alarms import Alarm
from alula.records.causes.failures import skill_failures
from alula.records.causes.fault_file import effects_of_robot
from alula.records.causes.faults import Fault, faults_asked, trace
from alula.records.causes.responses import response_to_fault
from alula.records.causes.told_ends import with_told_ends
from alula.records.kinds import with_kind
from alula.records.tree import Places
from alula.runtime.core.events import ExecutionEvent, TransitionEvent, event_record

DRONE = effects_of_robot()
VIOLATED, TERMINATED, NOT_READY = S.RESOURCE_INVARIANT_VIOLATED, S.TERMINATED, S.NOT_READY


def change(at_s, name, source, target, cause="extern"):
    skillset, resource = name.split(".")
    return TransitionEvent(0, round(at_s * 1e9), resource, source, target, cause, skillset)


def end(at_s, name, state, result="", message="", number=1, states=None):
    """Return an end; of a result, a failure; ``states``: of the resources that an unmet condition asks."""
    skillset, skill = name.split(".")
    kind = ResultKind.FAILURE if state is TERMINATED else None
    unmet = () if states is None else (Unmet(result, "", message, states, {}),)
    return ExecutionEvent(0, round(at_s * 1e9), skill, f"{skill} {number}", state, result, message, {}, {}, skillset, kind, unmet)


def started(at_s, name, number=1):
    return [end(at_s, name, state, number=number) for state in (S.REQUESTED, S.RUNNING)]


def zed_breaks(at_s, number=1):
    broken = end(at_s, "perception.zed_depthmap", VIOLATED, "zed_ok", number=number, states={"zed_status": "BROKEN"})
    return [change(at_s, "perception.zed_status", "OK", "BROKEN"), broken]


def faults(*several):
    return [Fault(name, at_s, until_s, DRONE.of(name)) for name, at_s, until_s in several]


def told(several, *parts):
    """Return of each fault when it was detected, and when skills failed because of it."""
    events = [event for part in parts for event in (part if isinstance(part, list) else [part])]
    return [(traced.detected_s, [one.end.stamp_s for one in traced.failures]) for traced in trace(faults(*several), events)]


BLOCKED = end(35.0, "navigation.goto", TERMINATED, "BLOCKED", "no nearer to the target for 5.1 s")


def test_a_skill_that_fails_for_another_reason_after_a_fault_is_no_answer_to_it():
    assert told([("zed", 30.0, math.inf)], BLOCKED) == [(None, [])]
    assert told([("zed", 30.0, math.inf)], zed_breaks(30.3), BLOCKED) == [(30.3, [30.3])]
    lost = end(33.0, "video.stream", TERMINATED, "LOST", "nothing was heard of the video encoder for 1.2 s")
    assert told([("radio", 30.0, math.inf), ("encoder", 32.0, math.inf)], lost) == [(None, []), (33.0, [33.0])]


def test_of_two_faults_each_has_the_failures_that_follow_from_its_own_resource():
    lidar = change(22.3, "perception.lidar_status", "OK", "BROKEN")
    stopped = end(22.3, "perception.lidar_depthmap", VIOLATED, "lidar_ok", states={"lidar_status": "BROKEN"})
    several = [("zed", 20.0, math.inf), ("lidar", 22.0, math.inf)]
    unused = change(20.3, "perception.zed_status", "OK", "BROKEN")
    assert told(several, unused, lidar, stopped) == [(20.3, []), (22.3, [22.3])]


def test_of_two_faults_of_one_sensor_the_failure_follows_from_the_one_that_holds():
    mended = change(30.3, "perception.zed_status", "BROKEN", "OK")
    twice = [("zed", 20.0, 30.0), ("zed", 50.0, math.inf)]
    assert told(twice, zed_breaks(20.3), mended, zed_breaks(50.3, 2)) == [(20.3, [20.3]), (50.3, [50.3])]
    assert told(twice, zed_breaks(50.3)) == [(None, []), (50.3, [50.3])], "the first one ended before it was detected"
    assert told([("zed", 20.0, 30.0)], zed_breaks(50.3)) == [(None, [])], "what broke later broke by itself"


def test_a_skill_that_is_refused_for_a_resource_fails_by_the_fault_that_broke_it():
    refused = [end(41.0, "perception.lidar_depthmap", S.REQUESTED)]
    refused += [end(41.0, "perception.lidar_depthmap", NOT_READY, "lidar_ready", states={"lidar_status": "BROKEN"})]
    events = [change(10.3, "perception.lidar_status", "OK", "BROKEN"), *refused, *started(41.2, "navigation.hover")]
    (traced,) = trace(faults(("lidar", 10.0, math.inf)), events)
    response, after_s = response_to_fault(traced, events, Places())
    assert (traced.detected_s, response.skill, after_s) == (10.3, "navigation.hover", pytest.approx(0.2))


def test_a_mapping_that_gets_no_scans_fails_by_the_lidar():
    silent = end(33.0, "mapping.lidar_mapping", TERMINATED, "ABORTED", "no scan registered for 3.1 s")
    broken = change(30.3, "perception.lidar_status", "OK", "BROKEN")
    assert told([("lidar:dead", 30.0, math.inf)], broken, silent) == [(30.3, [33.0])]


def test_the_authority_is_lost_by_the_control_link_and_not_by_a_radio_that_fails_beside_it():
    lost = change(10.7, "navigation.SDK_authority", "AVAILABLE", "UNAVAILABLE")
    stopped = end(10.7, "navigation.hover", VIOLATED, "keep_sdk_authority", states={"SDK_authority": "UNAVAILABLE"})
    assert told([("control", 5.7, 33.0), ("radio", 6.5, math.inf)], lost, stopped) == [(10.7, [10.7]), (None, [])]
    assert told([("radio", 6.5, math.inf)], lost, stopped) == [(10.7, [10.7])], "the control link is a radio link, too"


def test_what_a_skill_changes_or_what_becomes_well_tells_of_no_fault():
    taken = change(30.1, "navigation.SDK_authority", "AVAILABLE", "UNAVAILABLE", "goto 1 release")
    well = change(30.1, "perception.zed_status", "UNKNOWN", "OK")
    assert told([("pilot", 30.0, math.inf), ("zed", 30.0, math.inf)], taken, well) == [(None, []), (None, [])]


def test_a_fault_that_is_not_known_affects_what_has_its_name():
    assert told([("slam", 5.0, math.inf)], change(5.2, "mapping.slam_status", "OK", "LOST")) == [(5.2, [])]
    assert told([("navigation", 5.0, math.inf)], end(6.0, "navigation.goto", S.FAILED)) == [(6.0, [6.0])]
    assert told([("slam", 5.0, math.inf)], BLOCKED) == [(None, [])]


def test_faults_come_when_they_were_asked_for_and_have_the_effects_that_the_behaviour_declares():
    events = [
        change(0.5, "navigation.flight_status", "ON_GROUND", "IN_AIR"),
        change(100.0, "navigation.flight_status", "IN_AIR", "ON_GROUND"),
    ]
    requests = [parse_fault(text) for text in ("zed:dark@50", "zed@20-30", "lidar@95")]
    found = faults_asked(requests, events, 10.0, DRONE)
    assert [(str(one), fault.name, fault.at_s, fault.until_s) for one, fault in found] == [
        ("zed@20-30", "zed", 30.0, 40.0),
        ("zed:dark@50", "zed:dark", 60.0, math.inf),
    ]
    assert all(fault.effects == DRONE.of("zed") for _, fault in found)
    assert faults_asked(requests, [], 10.0, DRONE) == []


def test_the_end_of_an_execution_whose_managers_have_gone_is_what_the_mission_was_told():
    begun, ended = (
        started(4.0, "perception.zed_depthmap"),
        [*started(5.0, "mapping.lidar_mapping"), end(9.0, "mapping.lidar_mapping", TERMINATED)],
    )
    later = change(31.0, "perception.zed_status", "UNKNOWN", "OK")

    def report(at_s, name, state, number=1):
        skillset, skill = name.split(".")
        said = {"skillset": skillset, "skill": skill, "id": f"{skill} {number}", "state": state, "message": "the managers have gone"}
        return Entry(REPORTS, round(at_s * 1e9), said)

    reports = [report(30.0, "perception.zed_depthmap", state) for state in ("RUNNING", "FAILED", "FAILED")]
    reports += [report(9.1, "mapping.lidar_mapping", "TERMINATED"), report(30.0, "perception.lidar_depthmap", "FAILED", 2)]
    known = with_told_ends([*begun, *ended, later], reports)
    (told,) = [event for event in known if event not in [*begun, *ended, later]]
    assert known.index(told) == len(known) - 2
    assert (told.stamp_s, told.skillset, told.skill, told.state) == (30.0, "perception", "zed_depthmap", S.FAILED)
    (traced,) = trace([Fault("perception", 29.5, effects=DRONE.of("perception"))], known)
    assert (traced.detected_s, [one.end for one in traced.failures]) == (30.0, [told])


def test_messages_name_no_causes():
    taken, broken = change(30.0, "perception.lidar_status", "OK", "BROKEN"), change(30.2, "perception.zed_status", "OK", "BROKEN")
    said = "zed_ok: zed_status is BROKEN; skill f, effect g: resource lidar_status is BROKEN and has no transition BROKEN -> OK"
    ended = end(30.2, "perception.zed_depthmap", VIOLATED, "zed_ok", said, states={"zed_status": "BROKEN"})
    assert [failure.behind for failure in skill_failures([broken, taken, ended])] == [(0,)]
    silent = end(30.2, "perception.zed_depthmap", VIOLATED, "zed_ok", said)
    assert [failure.behind for failure in skill_failures([broken, taken, silent])] == [()], "a record that does not say it"


def test_kinds_of_results_that_a_record_does_not_say_are_those_of_the_model():
    ended = [("goto", "BLOCKED"), ("goto", "ARRIVED"), ("lock_head", "UNLOCKED"), ("goto", "?"), ("fly", "BLOCKED")]
    events = [ExecutionEvent(0, 0, skill, "1", TERMINATED, result, "", {}, {}, "navigation") for skill, result in ended]
    events += [ExecutionEvent(0, 0, "goto", "1", TERMINATED, "BLOCKED", "", {}, {}, "rover")]
    failure, success = ResultKind.FAILURE, ResultKind.SUCCESS
    assert [event.result_kind for event in with_told_ends(events, [])] == [failure, success, failure, None, None, None]
    assert [with_kind(event_record(event))["result_kind"] for event in events] == ["failure", "success", "failure", "", "", ""]
    said = replace(events[0], result_kind=ResultKind.PLAIN)
    assert with_told_ends([said], []) == [said], "what a record says counts"


ROVER = """
skillset rover {
  resource {
    scanner_status {
      initial BLIND
      extern BLIND -> FINE
      extern FINE -> BLIND
      extern FINE -> DEAD
    }
    arm_status {
      initial OK
      extern OK -> BROKEN
    }
    gear {
      initial IN
      IN -> OUT
      OUT -> IN
    }
  }
  skill drive {
    effect { engage: gear -> IN }
    invariant {
      sees: resource = (scanner_status == FINE and (arm_status == OK or arm_status == BROKEN))
      engaged: resource = (gear == IN)
    }
    result { DONE: apply = engage }
  }
}
"""


def test_a_robot_without_a_file_has_the_rule_by_names(monkeypatch, tmp_path):
    (tmp_path / "robot.yaml").write_text("name: rover\n")
    (tmp_path / "skillsets").mkdir()
    (tmp_path / "skillsets/rover.skill").write_text(ROVER)
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    effects = effects_of_robot()
    assert effects.of("scanner").states == {"rover.scanner_status DEAD", "rover.scanner_status BLIND"}
    assert effects.of("arm").states == frozenset(), "no invariant tells which of its states is bad"
    told = [("scanner_status", "DEAD"), ("scanner_status", "FINE"), ("scanner_status", "BLIND"), ("arm_status", "BROKEN"), ("gear", "OUT")]
    found = [effects.alarms.of(f"rover.{resource}", state) for resource, state in told]
    assert found == [Alarm.ALWAYS, Alarm.NONE, Alarm.AWAY, Alarm.NONE, Alarm.NONE], "by what they break, not by how they sound"
    well = [change(1.0, "rover.scanner_status", "BLIND", "FINE"), change(2.0, "rover.scanner_status", "FINE", "DEAD")]
    assert [traced.changes for traced in trace([Fault("scanner", 0.0, effects=effects.of("scanner"))], well)] == [(well[1],)]


def test_what_a_fault_of_the_robot_shows_is_an_alarm_and_where_a_resource_begins_only_away():
    alarms = effects_of_robot().alarms
    told = ("perception.zed_status BROKEN", "perception.zed_status UNKNOWN", "perception.zed_status OK", "video.link DOWN")
    told += ("navigation.SDK_authority UNAVAILABLE", "navigation.flight_status ON_GROUND", "mapping.slam_status LOST")
    A = Alarm  # noqa: N806 - for a table
    assert [alarms.of(*one.split()) for one in told] == [A.ALWAYS, A.AWAY, A.NONE, A.ALWAYS, A.AWAY, A.NONE, A.ALWAYS]


@pytest.mark.parametrize(
    ("shown", "blind"), [("states: {rover.scanner_status: BLIND}", Alarm.AWAY), ("ends: {rover.drive: sees}", Alarm.NONE)]
)
def test_where_a_file_tells_what_faults_show_the_state_in_which_a_resource_begins_is_bad_only_by_a_fault(
    shown, blind, monkeypatch, tmp_path
):
    """As a charger that is OFF: it breaks an invariant of whoever charges, and a robot on its way has no need of it."""
    (tmp_path / "robot.yaml").write_text("name: rover\n")
    (tmp_path / "skillsets").mkdir()
    (tmp_path / "skillsets/rover.skill").write_text(ROVER)
    (tmp_path / "skillsets/faults.yaml").write_text(f"faults: {{scanner: {{{shown}}}}}")
    monkeypatch.setenv("ALULA_ROBOT", str(tmp_path))
    alarms = effects_of_robot().alarms
    assert alarms.of("rover.scanner_status", "BLIND") is blind
    assert alarms.of("rover.scanner_status", "DEAD") is Alarm.ALWAYS, "what breaks an invariant and is not how it begins"


FLOWN = {
    ("mapping", "zed@20-30", "zed@50"): [("zed, ends again", "LiDAR navigation", 0.35), ("zed", "nothing failed", None)],
    ("mapping", "lidar@10", "zed@20"): [("lidar", "given up", 0.01), ("zed", "given up", 0.36)],
    ("mapping", "zed"): [("zed", "LiDAR navigation", 0.01)],
    ("mapping", "lidar", "zed@2"): [("lidar", "nothing failed", None)],
    ("mapping", "pilot@99"): [("pilot", "given up", None)],
    ("inspection", "lidar@20", "control@31"): [("lidar", "given up", 0.36), ("control", "not detected", None)],
    ("inspection", "control@5.7-33.2", "radio@6.5"): [("control, ends again", "given up", None), ("radio", "the video was lost", 3.115)],
    ("inspection", "zed@20", "lidar@40"): [("zed", "nothing failed", None), ("lidar", "given up", 0.36)],
    ("inspection", "radio:degraded@20"): [("radio:degraded", "not detected", None)],
    ("inspection", "ground_station@20"): [("ground_station", "the video was lost", 3.215)],
    ("inspection", "encoder@20"): [("encoder", "the video was lost", 1.12)],
}


@pytest.mark.parametrize("flight", FLOWN, ids=" ".join)
def test_faults_of_flights_over_mocks_are_answered_by_what_follows_from_them(flight):
    scenario, *requests = flight
    (row,) = rows_of([PlannedRun(0, scenario, 0, tuple(requests))], MOCKS, (), "")
    found = [(one["name"], one["answered_by"], one["after_s"]) for one in row["failures"] if one["kind"] == "fault"]
    assert found == [(name, branch, after_s if after_s is None else pytest.approx(after_s)) for name, branch, after_s in FLOWN[flight]]


def test_a_skill_that_fails_by_chance_after_a_fault_does_not_answer_it(tmp_path):
    behaviour = tmp_path / "blocked.yaml"
    behaviour.write_text("skills: {navigation.goto: {result: ABORTED}}\n", encoding="utf-8")
    (row,) = rows_of([PlannedRun(0, "inspection", 0, ("zed@1",))], MOCKS, (str(behaviour),), "")
    found = {(one["kind"], one["name"]): one["answered_by"] for one in row["failures"]}
    assert found["fault", "zed"] == "nothing failed"
    assert found["result", "navigation.goto ABORTED"] == "given up"
