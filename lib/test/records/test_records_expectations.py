"""Expectations: written from a run it fulfils them, each kind fails with the place in both, and the paper's figures hold."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.cli.expect import main
from alula.common import run_log
from alula.common.faults import parse_fault
from alula.common.robots import VARIABLE, load_robot_folder
from alula.records.errors import AnalysisError
from alula.records.expectations import check, expectations_of, junit, load_expectations
from alula.records.run import RecordedRun, load_recorded_run
from alula.runtime.core.events import event_record

ROOT = Path(os.environ["ALULA_ROOT"])
FIGURES = ROOT / "tests" / "expectations"


@pytest.fixture(scope="module")
def runs():
    flights = load_mocked_scenario("mapping")
    flown = {"nominal": flights.run(), "failing": flights.run([parse_fault("zed@30")])}
    of_drone = load_robot_folder(ROOT).departure
    return {name: RecordedRun(Path(name), one.events, {"outcome": one.end.outcome.value}, of_drone) for name, one in flown.items()}


def problems(path, run):
    return [one.problem for one in check(load_expectations(path), run) if one.problem]


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["mapping", "inspection"])
def test_what_is_written_of_a_run_does_not_depend_on_where_one_stands(name, tmp_path, monkeypatch):
    here = expectations_of(load_recorded_run(ROOT / "tests" / "recordings" / name))
    for elsewhere in (tmp_path, ROOT / "examples" / "rover"):
        monkeypatch.chdir(elsewhere)
        monkeypatch.delenv(VARIABLE, raising=False)
        assert expectations_of(load_recorded_run(ROOT / "tests" / "recordings" / name)) == here


@pytest.mark.parametrize(("figure", "fits", "differs"), [("11", "nominal", "failing"), ("12", "failing", "nominal")])
def test_a_mock_flight_is_as_the_paper_shows_it_and_the_other_is_not(runs, figure, fits, differs):
    path = FIGURES / f"figure-{figure}.yaml"
    assert problems(path, runs[fits]) == []
    assert len(problems(path, runs[differs])) > 3


@pytest.mark.parametrize(("figure", "recording"), [("11", "mapping"), ("12", "mapping-zed")])
def test_a_flight_of_the_whole_stack_is_as_the_paper_shows_it(figure, recording):
    assert problems(FIGURES / f"figure-{figure}.yaml", load_recorded_run(ROOT / "tests" / "recordings" / recording)) == []


@pytest.mark.parametrize("name", ["nominal", "failing"])
def test_what_is_written_from_a_run_is_fulfilled_by_it_and_by_no_other(runs, name, tmp_path):
    path = written(tmp_path / "e.yaml", expectations_of(runs[name]))
    assert problems(path, runs[name]) == []
    (other,) = set(runs) - {name}
    assert problems(path, runs[other]) != []


def test_an_end_that_is_late_or_missing_or_new_is_found(runs, tmp_path):
    run = runs["failing"]
    path = written(tmp_path / "e.yaml", expectations_of(run))
    land = next(at for at, event in enumerate(run.events) if getattr(event, "result", "") == "LANDED")
    late = [*run.events[:land], replace(run.events[land], stamp_ns=run.events[land].stamp_ns + 2_500_000_000)]
    problem, besides = problems(path, replace(run, events=late))
    assert "navigation.land TERMINATED LANDED besides" in besides
    assert problem.startswith("failing: it is navigation event ")
    assert "+2.5" in problem
    (problem,) = problems(path, replace(run, events=run.events[:land]))
    assert problem == "failing: it never happens"
    again = [*run.events, *(replace(event, stamp_ns=run.events[-1].stamp_ns) for event in run.events[-1:])]
    (problem,) = problems(path, replace(run, events=again))
    assert "besides" in problem


CASES = {
    "outcome: [accomplished, given_up]": "failing: it is degraded",
    "order: [land RUNNING, takeoff RUNNING]": "it does not happen after navigation event",
    "order: [fly RUNNING]": "failing: it never happens",
    "order: [land RUNNING, land RUNNING]": "failing: it does not happen after",
    "order: [{what: takeoff RUNNING, at_s: 3, tolerance_s: 0.5}]": "s, -5.500 s off",
    "complete: true": "failing: navigation.takeoff RUNNING besides (navigation event 6 at -2.500 s), and ",
    "states: [{at_s: 60, perception.zed_status: OK, perception.lidar_status: BROKEN}]": (
        "failing: perception.zed_status is BROKEN since perception event 5 at 30.340 s, perception.lidar_status is OK since "
    ),
    "states: [{at_s: -100, perception.zed_status: OK}]": "perception.zed_status is UNKNOWN from the beginning",
    "states: [{at_s: 1, door.lock: OPEN}]": "door.lock is never told of",
    'never: ["*.zed_* RESOURCE_INVARIANT_VIOLATED"]': "perception.zed_depthmap RESOURCE_INVARIANT_VIOLATED zed_ok (perception event 6",
    "never: [{what: goto RUNNING, after: zed_status BROKEN}]": "failing: navigation.goto RUNNING",
}


@pytest.mark.parametrize("text", CASES)
def test_each_kind_of_expectation_fails_with_the_place_in_both(text, runs, tmp_path):
    path = written(tmp_path / "e.yaml", f"about: one\n{text}\n")
    failed = [one for one in check(load_expectations(path), runs["failing"]) if one.problem]
    assert len(failed) == 1
    assert failed[0].place == f"{path}:2"
    assert CASES[text] in failed[0].problem


WRONG = {
    "": "is empty; expectations may have about, outcome",
    "x: 1": "e.yaml:1: expectations has no `x`",
    "outcome: good": "e.yaml:1: there is no outcome `good`; there are accomplished",
    "order: [takeoff]": "e.yaml:1: an event is SKILL STATE",
    "order:\n  - {at_s: 2}": "e.yaml:2: an event needs `what`",
    "order: [{what: a RUNNING, at_s: soon}]": "e.yaml:1: `at_s` should be a number",
    "complete: perhaps": "e.yaml:1: `complete` should be true or false, not 'perhaps'",
    "states: [{a.b: C}]": "e.yaml:1: states need `at_s`",
    "states: [{at_s: 1, b: C}]": "e.yaml:1: `b` should be skillset.resource",
    "never: [{after: a B}]": "e.yaml:1: what must not happen needs `what`",
    "a: [": "e.yaml:2: is no YAML",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_file_is_refused_with_file_and_line(text, tmp_path):
    with pytest.raises(AnalysisError) as raised:
        load_expectations(written(tmp_path / "e.yaml", text + "\n"))
    assert WRONG[text] in str(raised.value)


def test_junit_names_what_failed(runs, tmp_path):
    path = written(tmp_path / "e.yaml", "outcome: degraded\nnever: [land RUNNING]\n")
    suite = ET.fromstring(junit("run", check(load_expectations(path), runs["failing"]))).find("testsuite")  # noqa: S314 - our own
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    assert [(case.get("name"), case.find("failure") is None) for case in suite] == [
        ("outcome degraded", True),
        ("never land RUNNING", False),
    ]


def test_the_command_writes_checks_and_refuses(runs, tmp_path, capsys):
    lines = "".join(json.dumps(event_record(event)) + "\n" for event in runs["failing"].events)
    written(tmp_path / "events.jsonl", lines)
    run_log.note(tmp_path, run_log.MISSION, {"outcome": "degraded"})
    assert load_recorded_run(tmp_path).outcome == "degraded"
    assert main([str(tmp_path)]) == 0
    path = written(tmp_path / "e.yaml", capsys.readouterr().out)
    assert main([str(tmp_path), "--check", str(path), "--junit", str(tmp_path / "j.xml")]) == 0
    assert "expectations fulfilled" in capsys.readouterr().out
    assert (tmp_path / "j.xml").is_file()
    path.write_text(path.read_text(encoding="utf-8").replace("degraded", "given_up"), encoding="utf-8")
    assert main([str(tmp_path), "--check", str(path)]) == 1
    assert f"{path}:2: outcome given_up: {tmp_path}: it is degraded" in capsys.readouterr().out
    assert main([str(tmp_path), "--check", str(tmp_path / "none.yaml")]) == 2
    assert capsys.readouterr().err.startswith("alula expect: ")
