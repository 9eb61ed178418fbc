"""What a report credits to a fault: only what follows from it, and that it was not detected where nothing does."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from alula.common import run_log
from alula.common.record import FILE as RECORD
from alula.records.errors import AnalysisError
from alula.report import making
from alula.report.facts import RunFacts
from alula.report.making import make_report

sys.path.insert(0, str(Path(__file__).parent))
from test_report_sample import write_bag

from alula_testing.run_log import LIFT_OFF_S, Log, failing_flight

Fault = tuple[str, float] | tuple[str, float, float]
NOTHING = ("nothing failed", None)
UNSEEN = ("not detected", None)


def flight(*breaks: tuple[str, float], scenario: str = "mapping") -> Log:
    """Return a flight from which the ZED looks ahead from 4.7 s on (inspection: the LiDAR), and in which sensors break."""
    log, running = Log(), {"mapping": "zed", "inspection": "lidar"}[scenario]
    log.change(0.0, "navigation.flight_status", "ON_GROUND", "IN_AIR")
    for sensor in ("zed", "lidar"):
        log.change(-3.0, f"perception.{sensor}_status", "UNKNOWN", "OK")
    log.skill(4.7, f"perception.{running}_depthmap", "1", "REQUESTED")
    log.skill(4.7, f"perception.{running}_depthmap", "1", "RUNNING")
    for number, (sensor, at_s) in enumerate(breaks):
        log.change(at_s, f"perception.{sensor}_status", "OK", "BROKEN")
        if sensor == running and sensor not in [before for before, _ in breaks[:number]]:
            found = {"name": f"{sensor}_ok", "condition": "", "reason": "", "states": {f"{sensor}_status": "BROKEN"}, "data": {}}
            violated = {"result": f"{sensor}_ok", "unmet": [found]}
            log.skill(at_s, f"perception.{sensor}_depthmap", "1", "RESOURCE_INVARIANT_VIOLATED", **violated)
    return log


def run(log: Log, id_: str, name: str, at_s: float, *end: Any) -> None:
    """Add an execution; ``end``: when, state, result, message."""
    log.skill(at_s, name, id_, "REQUESTED")
    log.skill(at_s + 0.02, name, id_, "RUNNING")
    if end:
        end_s, state, result, message = end
        log.skill(end_s, name, id_, state, result=result, message=message)


def report(
    folder: Path,
    log: Log,
    *faults: Fault,
    scenario: str = "mapping",
    asked: tuple[str, ...] = (),
    died: dict[str, float] | None = None,
    again_s: float | None = None,
) -> dict[str, Any]:
    """Return the summary; a fault: sensor, from, until, seconds after lift-off; ``died``: processes, and when; ``again_s``: they ran."""
    log.write(folder / RECORD)
    told = [{"sensor": name, "mode": "dead", "t_s": LIFT_OFF_S + at_s} for name, at_s, *_ in faults]
    told += [{"sensor": name, "mode": "ok", "t_s": LIFT_OFF_S + until[0]} for name, _, *until in faults if until]
    state = {"lift_off_s": LIFT_OFF_S, "collisions": 0, "min_clearance_m": 1.0, "distance_m": 1.0, "faults": told}
    t_s = np.arange(0.0, 80.0, 0.5)
    write_bag(folder / "functional.bag", poses=(t_s + LIFT_OFF_S, np.outer(t_s, [1.0, 0.0, 0.0])), states=[state])
    deaths = [
        {"name": name, "when_s": LIFT_OFF_S + at_s, "how": "signal SIGKILL", "again_s": again_s and LIFT_OFF_S + again_s}
        for name, at_s in (died or {}).items()
    ]
    facts = RunFacts(scenario=scenario, seed=0, out_dir=folder, faults=asked, died=deaths, mission_exit=0)
    return dict(make_report(facts))


def answers(summary: dict[str, Any]) -> list[tuple[str, float | None]]:
    return [(one["answered_by"], one["after_s"]) for one in summary["answers"]]


def recovery(summary: dict[str, Any]) -> list[float | None]:
    return [summary["recovery"][f"{name}_s"] for name in ("failure", "detected", "fallback_running", "moving_again")]


def test_the_recovery_counts_from_the_fault_that_was_answered(tmp_path):
    log = flight(("zed", 20.3), ("lidar", 40.3), scenario="inspection")
    run(log, "2", "navigation.hover", 40.4)
    summary = report(tmp_path, log, ("zed", 20.0), ("lidar", 40.0), scenario="inspection")
    assert recovery(summary) == [40.0, 40.3, 40.42, None]
    assert answers(summary) == [NOTHING, ("navigation.hover", 0.42)]
    assert [one["detected_by"] for one in summary["answers"]] == [f"perception.{sensor}_status OK -> BROKEN" for sensor in ("zed", "lidar")]


def test_a_fault_that_ended_undetected_has_not_the_recovery_of_the_next(tmp_path):
    log = flight(("zed", 50.3))
    run(log, "2", "perception.lidar_depthmap", 50.4)
    run(log, "3", "navigation.goto", 51.0)
    summary = report(tmp_path, log, ("zed", 20.0, 30.0), ("zed", 50.0))
    assert recovery(summary) == [50.0, 50.3, 50.42, 51.5]
    assert answers(summary) == [UNSEEN, ("perception.lidar_depthmap", 0.42)]
    assert [one["until_s"] for one in summary["answers"]] == [30.0, None]


def test_a_skill_that_fails_later_for_another_reason_is_no_answer(tmp_path):
    log = flight()
    run(log, "2", "navigation.goto", 10.0, 35.0, "TERMINATED", "BLOCKED", "no nearer to the target for 5.1 s")
    run(log, "3", "perception.lidar_depthmap", 35.1)
    summary = report(tmp_path, log, ("zed", 30.0))
    assert recovery(summary) == [30.0, None, None, None]
    assert answers(summary) == [UNSEEN]


def test_the_fallback_that_runs_after_another_failure_is_not_credited(tmp_path):
    log = flight(("zed", 30.3))
    run(log, "2", "navigation.goto", 10.0, 35.0, "TERMINATED", "BLOCKED", "no nearer to the target for 5.1 s")
    run(log, "3", "perception.lidar_depthmap", 35.1)
    assert recovery(report(tmp_path, log, ("zed", 30.0))) == [30.0, 30.3, None, None]


@pytest.mark.parametrize(("at_s", "breaks", "answer"), [(-5.0, [], UNSEEN), (75.0, [("lidar", 75.3)], NOTHING)])
def test_a_fault_on_the_ground_interrupts_no_flight(at_s, breaks, answer, tmp_path):
    log = flight(*breaks)
    log.change(70.0, "navigation.flight_status", "IN_AIR", "ON_GROUND")
    summary = report(tmp_path, log, ("lidar", at_s))
    assert (summary["recovery"], answers(summary)) == (None, [answer])


def test_a_mapping_that_gets_no_scans_is_traced_to_the_lidar(tmp_path):
    log = flight(("lidar", 20.3))
    run(log, "2", "mapping.lidar_mapping", 5.0, 23.1, "TERMINATED", "ABORTED", "no scan registered for 3.1 s")
    run(log, "3", "navigation.hover", 23.2)
    (found,) = report(tmp_path, log, ("lidar", 20.0))["answers"]
    assert (found["sensor"], found["failed"], found["detected_by"]) == ("lidar", ["2"], "perception.lidar_status OK -> BROKEN")
    assert (found["skill"], found["after_s"]) == ("navigation.hover", 3.22)


def test_the_radios_faults_are_traced_though_no_bag_tells_of_them(tmp_path):
    log = flight(scenario="inspection")
    log.change(12.0, "video.link", "UP", "DOWN")
    run(log, "2", "video.stream", 5.0, 13.2, "RESOURCE_INVARIANT_VIOLATED", "enough_frames", "enough_frames: picture.fps_margin is -6")
    run(log, "3", "navigation.hover", 13.3)
    summary = report(tmp_path, log, scenario="inspection", asked=("radio:out@10", "radio:out@400"))
    assert recovery(summary) == [10.0, 12.0, 13.32, None]
    assert answers(summary) == [("navigation.hover", 3.32)]


def test_what_breaks_without_a_fault_that_is_known_has_a_recovery_without_a_failure(tmp_path):
    summary = report(tmp_path, failing_flight())
    assert recovery(summary)[:3] == [None, 30.25, 30.45]
    assert summary["answers"] == []


GONE = "the managers of perception have gone: they ended, or sent no heartbeat"


def test_managers_that_die_are_told_as_detected_by_what_the_mission_was_told(tmp_path):
    log = flight()
    log.told(31.2, "perception.zed_depthmap", "1", "FAILED", GONE)
    run(log, "2", "perception.lidar_depthmap", 33.0)
    summary = report(tmp_path, log, died={"perception": 30.0})
    (found,) = summary["answers"]
    assert (found["sensor"], found["mode"], found["t_s"], found["failed"]) == ("perception", "died", 30.0, ["1"])
    assert (found["detected_s"], found["detected_by"]) == (31.2, "perception.zed_depthmap FAILED")
    assert (found["skill"], found["after_s"]) == ("perception.lidar_depthmap", 3.02)
    assert recovery(summary)[:3] == [30.0, 31.2, 33.02]
    (zed,) = [one for one in summary["skills"] if one["skill"] == "zed_depthmap"]
    assert (zed["outcome"], zed["end_s"], zed["message"]) == ("FAILED", 31.2, GONE)


def test_what_fails_long_after_a_process_ran_again_is_not_credited_to_its_death(tmp_path):
    log = flight()
    log.told(31.2, "perception.zed_depthmap", "1", "FAILED", GONE)
    for again_s, failed in ((None, ["1"]), (29.0, ["1"]), (25.0, [])):
        folder = tmp_path / str(again_s)
        folder.mkdir()
        (found,) = report(folder, log, died={"perception": 20.0}, again_s=again_s)["answers"]
        assert (found["failed"], found["until_s"]) == (failed, again_s)


def test_a_process_that_nothing_hung_on_dies_without_a_recovery(tmp_path):
    summary = report(tmp_path, flight(), died={"lidar_mapping": 30.0})
    assert (answers(summary), summary["recovery"]) == ([UNSEEN], None)


def test_a_process_that_a_fault_has_ended_is_told_once(tmp_path):
    applied = {"sensor": "encoder", "mode": "killed", "t_s": LIFT_OFF_S + 20.0}
    run_log.note(tmp_path, run_log.FAULT, applied)
    summary = report(tmp_path, flight(scenario="inspection"), scenario="inspection", died={"video_stream": 20.1, "perception": 25.0})
    assert [(one["sensor"], one["mode"]) for one in summary["answers"]] == [("encoder", "killed"), ("perception", "died")]


def test_a_file_of_faults_that_is_wrong_costs_no_report(tmp_path, monkeypatch):
    def wrong():
        raise AnalysisError("faults.yaml:3: there is no resource")

    monkeypatch.setattr(making, "effects_of_robot", wrong)
    summary = report(tmp_path, flight(("zed", 30.3)), ("zed", 30.0))
    assert "what faults can bring about: AnalysisError: faults.yaml:3: there is no resource" in summary["problems"]
    assert [one["detected_s"] for one in summary["answers"]] == [30.3], "by its name"


def mocked(folder: Path, asked: tuple[str, ...], *told: tuple[str, str, float]) -> dict[str, Any]:
    """Return the summary of a flight over mocks whose account tells of these faults."""
    flight(("zed", 20.3), ("zed", 50.3)).write(folder / RECORD)
    faults = [{"sensor": sensor, "mode": mode, "t_s": LIFT_OFF_S + at_s} for sensor, mode, at_s in told]
    for fault in faults:
        run_log.note(folder, run_log.FAULT, fault)
    return dict(make_report(RunFacts("mapping", 0, folder, asked, (), 0, mock=True)))


def test_mocks_tell_each_fault_of_a_sensor_and_when_it_ended(tmp_path):
    asked = ("zed@50", "zed:dark@20-30", "zed@500", "lidar@700")
    summary = mocked(tmp_path, asked, ("zed", "dark", 20.0), ("zed", "ok", 30.0), ("zed", "mock", 50.0))
    assert [(one["mode"], one["t_s"]) for one in summary["injected"]] == [("dark", 20.0), ("mock", 50.0)]
    assert [one["until_s"] for one in summary["answers"]] == [30.0, None]
    assert never(summary) == [f"the fault {fault} never happened: the run was over 50.3 s after the lift-off" for fault in asked[2:]]


def never(summary):
    return [problem for problem in summary["problems"] if "never happened" in problem]


def test_a_fault_of_a_scenario_that_never_came_over_mocks_is_told(tmp_path):
    flight(("zed", 20.3)).write(tmp_path / RECORD)
    faults = ("radio:out@900", "encoder@10", "control:lost")
    summary = make_report(RunFacts("inspection", 0, tmp_path, faults, (), 0, mock=True))
    assert never(summary) == [
        "the fault radio:out@900 never happened: the run was over 20.3 s after the lift-off",
        "the fault encoder@10 never happened",
        "the fault control:lost never happened",
    ]
