"""Campaigns: the same file gives the same runs, a table survives a kill, and the coverage counts what the rows say."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from collections import Counter
from dataclasses import asdict

import pytest
from campaign_mocks import fly_recorded

from alula.campaign.coverage import cover, is_troubled, processes
from alula.campaign.failures import FAULT, INVARIANT, PROCESS, RESULT, TRANSITION, Failure, Way, failures_in, ways_to_fail
from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.campaign.plan import MOCKS, PlannedRun, load_campaign
from alula.campaign.rendering import as_page, as_text
from alula.campaign.rows import rows_of
from alula.campaign.table import ROWS, Table
from alula.cli.campaign import main
from alula.common.record import read_record
from alula.common.scenarios import load_scenario, scenario_names
from alula.records.errors import AnalysisError
from alula.records.models import robot_skillsets
from alula.records.tree import Places, places_in, tip_of

DRAWN = """
scenarios: [mapping, inspection]
runs: 12
seed: 3
draw:
  faults: {mapping: [zed, lidar], inspection: [radio, "zed:dark"]}
  most: 2
  at_s: [0, 60]
  lasts_s: [5, 9]
"""
# The campaign's process is killed in the moment in which its first rows are in the table.
KILLED_AFTER_FIRST_ROWS = """
import os, signal, sys
from alula.cli import campaign as command
from alula.campaign.table import Table

class Killed(Table):
    def add(self, rows):
        super().add(rows)
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    command.Table = Killed
    sys.exit(command.main())
"""


def campaign_file(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_drawn_runs_are_those_of_the_file_and_more_of_them_change_none(tmp_path):
    drawn = load_campaign(campaign_file(tmp_path / "a.yaml", DRAWN)).runs
    longer = load_campaign(campaign_file(tmp_path / "b.yaml", DRAWN.replace("12", "50"))).runs
    other = load_campaign(campaign_file(tmp_path / "c.yaml", DRAWN.replace("seed: 3", "seed: 4"))).runs
    assert drawn == longer[:12]
    assert drawn != other
    assert Counter(run.scenario for run in longer) == {"mapping": 25, "inspection": 25}
    assert {len(run.faults) for run in longer} == {0, 1, 2}
    assert {fault.what for run in longer for fault in run.requests} == {"zed", "lidar", "radio"}
    assert all(0 <= fault.begin_s <= 60 for run in longer for fault in run.requests)
    lasting = [fault.end_s - fault.begin_s for run in longer for fault in run.requests if fault.end_s is not None]
    assert lasting
    assert all(4.8 <= seconds <= 9.2 for seconds in lasting)


IN_TURN = """
scenarios: [inspection, mapping, inspection]
runs: 12
draw:
  in_turn:
    mapping: [[], zed, [zed, lidar]]
    inspection: [[{"radio:out": 5}], ["encoder:hung", {control: 0.5}], radio]
  at_s: [3, 60]
  lasts_s: [5, 9]
"""


def test_runs_take_the_lists_of_their_scenario_in_turn(tmp_path):
    runs = load_campaign(campaign_file(tmp_path / "a.yaml", IN_TURN)).runs
    taken = {scenario: [one.requests for one in runs if one.scenario == scenario] for scenario in ("mapping", "inspection")}
    names = {scenario: [sorted(f"{fault.what}:{fault.how}" for fault in one) for one in several] for scenario, several in taken.items()}
    assert names["mapping"] == [[], ["zed:"], ["lidar:", "zed:"], []]
    assert names["inspection"] == ([["radio:out"], ["control:", "encoder:hung"], ["radio:"]] * 3)[:8]
    lasting = {f"{fault.what}:{fault.how}": set() for one in taken["inspection"] for fault in one}
    for fault in (fault for one in taken["inspection"] for fault in one):
        lasting[f"{fault.what}:{fault.how}"].add(None if fault.end_s is None else round(fault.end_s - fault.begin_s, 6))
    assert (lasting["radio:out"], lasting["control:"]) == ({5.0}, {0.5})
    begins = [fault.begin_s for several in taken.values() for one in several for fault in one]
    assert len(set(begins)) > len(begins) / 2, "times are drawn"


def test_listed_runs_are_every_combination(tmp_path):
    text = "scenarios: [mapping]\nseeds: [1, 2]\nfaults: [[], [zed@30], [zed@30, lidar@40-50]]\n"
    runs = load_campaign(campaign_file(tmp_path / "a.yaml", text)).runs
    assert [(one.seed, one.faults) for one in runs] == [
        (seed, faults) for seed in (1, 2) for faults in ((), ("zed@30",), ("zed@30", "lidar@40-50"))
    ]


WRONG = {
    "": "is empty; a campaign may have about, over",
    "run: 3": "a.yaml:1: a campaign has no `run`",
    "scenarios: [maping]": "a.yaml:1: there is no `maping`; there are inspection, mapping (did you mean `mapping`?)",
    "over: hills": "a.yaml:1: there is no `hills`; there are mocks, simulator",
    "runs: 3\nfaults: [zed]": "a.yaml:2: `faults` lists runs, `runs` draws them; use only one of both",
    "runs: 3": "a.yaml:1: a campaign that draws needs `draw`",
    "runs: 1.5\ndraw: {faults: [zed]}": "a.yaml:1: `runs` should be a whole number",
    "runs: 2\ndraw: {faults: [zed@3]}": "a.yaml:2: `zed@3` has a time",
    "runs: 2\ndraw: {faults: [zed], at_s: [9, 3]}": "a.yaml:2: `at_s` should be [from, to]",
    "runs: 2\nscenarios: [mapping, inspection]\ndraw: {faults: {mapping: zed}}": "a.yaml:3: `faults` has no entry for inspection",
    "runs: 2\ndraw: {at_s: [0, 9]}": "a.yaml:2: `draw` needs `faults` to draw from, or `in_turn`",
    "runs: 2\ndraw: {faults: [zed], in_turn: [zed]}": "a.yaml:2: `draw` needs `faults` to draw from, or `in_turn`",
    "runs: 2\ndraw: {in_turn: [zed], most: 2}": "a.yaml:2: `most` says how many of `faults` are drawn",
    "runs: 2\ndraw: {in_turn: [zed], least: 1}": "a.yaml:2: `least` says how many of `faults` are drawn",
    "runs: 2\ndraw: {faults: [zed, lidar], least: 3, most: 2}": "a.yaml:2: `most` should be a number from 3 to 100, not 2",
    "runs: 2\ndraw: {faults: [zed, lidar], most: 3}": "a.yaml:2: up to 3 of `faults` are to be drawn for inspection, and there are 2",
    "runs: 2\ndraw: {faults: [zed, [lidar, 'zed:dark']]}": "a.yaml:2: `zed` is in two entries, and could be drawn twice for a run",
    "runs: 2\ndraw: {faults: [zed, []]}": "a.yaml:2: an entry of `faults` has no fault",
    "runs: 2\ndraw: {in_turn: []}": "a.yaml:2: `in_turn` has no list for inspection",
    "runs: 2\ndraw: {in_turn: [zed@3]}": "a.yaml:2: `zed@3` has a time",
    "runs: 2\ndraw: {in_turn: [{zed: 3, lidar: 4}]}": "a.yaml:2: a fault with its time is `{NAME: SECONDS}`",
    "runs: 2\ndraw: {in_turn: [{zed: 0}]}": "a.yaml:2: how long a fault lasts should be a number from 0.1",
    "limit_s: 60": "a.yaml:1: `limit_s` is for the simulator only",
    "over: simulator\nlimit_s: 0": "a.yaml:2: `limit_s` should be a number from 1",
    "faults: [[zed@3-1]]": "a.yaml:1: fault 'zed@3-1'",
    "behaviour: no.yaml": "a.yaml:1: there is no file ",
    "worlds: {mapping: no.yaml}": "a.yaml:1: `worlds` is for the simulator only",
    "over: simulator\nworlds: {mapping: no.yaml}": "a.yaml:2: there is no file ",
    "scenarios: [mapping]\nover: simulator\nworlds: {inspection: no.yaml}": "a.yaml:3: `worlds` has no `inspection`; it may have mapping",
    "over: simulator\nbehaviour: no.yaml": "a.yaml:2: `behaviour` is for mocks only",
    "seeds: []": "a.yaml:1: `seeds` is empty, so there would be no run",
    "scenarios: []": "a.yaml:1: `scenarios` is empty, so there would be no run",
    "runs: 2\ndraw: {faults: []}": "a.yaml:2: `faults` has no fault to draw for inspection",
    "faults: [[rotor@3]]": "there is no fault 'rotor' in the behaviour; it has link:silent, zed",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_campaign_is_refused_before_it_begins(text, tmp_path, capsys):
    path = campaign_file(tmp_path / "a.yaml", text + "\n")
    assert main([str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("alula campaign: ")
    assert WRONG[text] in said
    assert not (tmp_path / "out").exists()


def test_the_ways_to_fail_are_those_of_the_models():
    names = {(way.kind, way.name) for way in ways_to_fail(robot_skillsets(), ["mission"])}
    assert (RESULT, "navigation.goto BLOCKED") in names
    assert (RESULT, "navigation.goto ARRIVED") not in names
    assert (INVARIANT, "perception.zed_depthmap zed_ok") in names
    assert (TRANSITION, "perception.zed_status OK -> BROKEN") in names
    assert (TRANSITION, "perception.zed_status BROKEN -> OK") not in names
    assert (PROCESS, "mission") in names
    assert {"mission", "navigation", "ros_bridge", "uav_guidance"} <= set(processes([load_scenario(name) for name in scenario_names()]))


def failures_of(scenario, *faults):
    mocked = load_mocked_scenario(scenario)
    done = mocked.run(PlannedRun(0, scenario, 0, faults).requests)
    return failures_in(done.events, ways_to_fail(mocked.skillsets), done.places)


def test_a_failure_is_answered_by_the_branch_of_the_tree_that_takes_over():
    moved, broken = failures_of("mapping", "zed@30")
    assert (moved.way, moved.answered_by) == (Way(TRANSITION, "perception.zed_status OK -> BROKEN"), "LiDAR navigation")
    assert (broken.way, broken.answered_by) == (Way(INVARIANT, "perception.zed_depthmap zed_ok"), "LiDAR navigation")
    assert (broken.skill, 0.0 < broken.after_s < 0.2) == ("perception.lidar_depthmap", True)
    *_, lost = failures_of("inspection", "radio@30")
    assert (lost.way.name, lost.answered_by, lost.skill) == ("video.stream enough_frames", "the video was lost", "navigation.hover")


def test_a_failure_after_which_nothing_is_started_is_answered_by_where_the_tree_ends_and_one_that_broke_nothing_by_nothing():
    taken, *broken = failures_of("mapping", "pilot@20")
    assert {(one.answered_by, one.skill, one.after_s) for one in (taken, *broken)} == {("given up", "no skill", None)}
    (unused,) = failures_of("mapping", "lidar@30")
    assert (unused.way.name, unused.answered_by, unused.after_s) == ("perception.lidar_status OK -> BROKEN", "not in use", None)
    assert isinstance(unused, Failure)


def test_a_record_tells_the_same_places_in_the_tree_as_the_run(tmp_path):
    mission = fly_recorded(tmp_path, "zed@10", "lidar@25")
    places = places_in(read_record(tmp_path))
    assert places == Places(mission.places, tip_of(mission.director.view().as_dict()))
    assert len(places.started) > 10
    assert {path[0] for path in places.started.values()} == {"mapping mission"}


def test_the_branch_that_answers_is_the_first_node_that_leads_elsewhere():
    places = Places(
        {"a": ("root", "fly", "zed", "leg"), "b": ("root", "fly", "lidar", "leg"), "c": ("root", "fly", "zed", "leg")}, ("root", "end")
    )
    assert (places.response("a", "b"), places.response("a", "c"), places.response("a", None)) == ("lidar", "zed", "end")
    assert (places.response("a", "?"), places.response("?", "a"), Places().response("a", None)) == ("", "", "")


def test_the_rows_of_runs_over_mocks_tell_of_their_faults():
    rows = rows_of([PlannedRun(0, "mapping", 0, ("zed@10-20", "lidar@3000"))], MOCKS, (), "")
    (fault,) = [failure for failure in rows[0]["failures"] if failure["kind"] == FAULT]
    assert (fault["name"], fault["at_s"], fault["answered_by"]) == ("zed, ends again", 10.0, "LiDAR navigation")
    assert 0.0 < fault["after_s"] < 1.0, "the fault that never came is none"


def row(number=0, **other):
    known = {
        "run": number,
        "faults": [],
        "outcome": "degraded",
        "landed": True,
        "open": [],
        "problems": [],
        "collisions": 0,
        "conforms": True,
    }
    return {**known, "min_clearance_m": 1.0, "died": [], "exit_code": 0, "failures": [], "answers": [], "scenario": "mapping", **other}


def test_the_coverage_counts_answers_and_keeps_the_worst():
    way, never = Way(INVARIANT, "a.b c"), Way(RESULT, "a.b BAD")
    failure = {"kind": way.kind, "name": way.name, "at_s": 3.0, "answered_by": "fall back", "skill": "a.hover", "after_s": 0.5}
    rows = [
        row(0, failures=[failure], faults=["zed:dark@900"]),
        row(1, failures=[{**failure, "after_s": 0.7}, {**failure, "answered_by": "come down", "after_s": 0.1}], min_clearance_m=0.4),
        row(2, failures=[{**failure, "kind": PROCESS, "name": "mission"}], outcome="given_up", conforms=False, seed=7),
    ]
    coverage = cover(rows, [way, never])
    told = coverage.as_dict()
    late = {"kind": FAULT, "name": "zed:dark"}
    assert told["again"] == {2: "mapping --seed 7"}
    assert told["tried"][1] == {
        "kind": INVARIANT,
        "name": "a.b c",
        "times": 3,
        "answers": {"fall back": 2, "come down": 1},
        "outcomes": {"degraded": 3},
        "worst_recovery_s": 0.7,
        "worst_clearance_m": 0.4,
    }
    assert (told["tried"][0]["name"], told["never"], told["troubled"]) == ("mission", [late, vars(never)], [2])
    assert told["outcomes"] == {"degraded": 2, "given_up": 1}
    text, page = as_text(coverage), as_page(coverage, "a < b")
    assert "never tried (2):\n  fault: zed:dark\n  result: a.b BAD" in text
    assert "2 fall back, 1 come down" in text
    assert "<title>a &lt; b</title>" in page
    assert page.count("<tr>") == 3


@pytest.mark.parametrize(
    "other",
    [
        {"conforms": False},
        {"open": ["x"]},
        {"collisions": 1},
        {"landed": False},
        {"problems": ["x"]},
        {"outcome": "not_started"},
        {"exit_code": 1},
    ],
)
def test_what_must_not_be_is_trouble(other):
    assert not is_troubled(row())
    assert is_troubled(row(**other))


@pytest.mark.parametrize(("fault", "landed"), [("pilot@20-40", True), ("pilot@20", None)])
def test_a_vehicle_that_the_pilot_took_over_is_the_missions_to_land_only_when_it_is_given_back(fault, landed):
    (row_,) = rows_of([PlannedRun(0, "inspection", 0, (fault,))], MOCKS, (), "")
    assert (row_["outcome"], row_["landed"], is_troubled(row_)) == ("given_up", landed, False)


def test_a_row_that_was_cut_off_is_flown_again_and_another_campaign_is_kept_out(tmp_path):
    campaign = load_campaign(campaign_file(tmp_path / "a.yaml", DRAWN))
    table = Table(tmp_path / "out", campaign)
    table.add([row(3), row(1)])
    with pytest.raises(AnalysisError, match="a campaign is being done there; wait for its end"):
        Table(tmp_path / "out", campaign)
    table.finish()
    path = tmp_path / "out" / ROWS
    assert [json.loads(line)["run"] for line in path.read_text(encoding="utf-8").splitlines()] == [1, 3]
    path.write_bytes(path.read_bytes()[:-5])
    again = Table(tmp_path / "out", campaign)
    assert set(again.rows) == {1}
    again.add([row(3)])
    again.finish()
    assert again.rows.keys() == {1, 3}
    assert len(path.read_text(encoding="utf-8").splitlines()) == 2
    with pytest.raises(AnalysisError, match="holds another campaign"):
        Table(tmp_path / "out", load_campaign(campaign_file(tmp_path / "b.yaml", DRAWN.replace("12", "13"))))
    with pytest.raises(AnalysisError, match="is not empty and holds no campaign"):
        Table(tmp_path, campaign)


DAMAGED = {"bytes": b"\xff{\n", "cut": b"{\n", "number": b"3\n", "little": b'{"run": 3}\n', "deep": b"[" * 10**5 + b"\n"}


@pytest.mark.parametrize("damaged", DAMAGED.values(), ids=DAMAGED)
def test_a_row_that_was_damaged_costs_no_other(damaged, tmp_path):
    campaign = load_campaign(campaign_file(tmp_path / "a.yaml", DRAWN))
    Table(tmp_path / "out", campaign).add([row(1), row(2)])
    path = tmp_path / "out" / ROWS
    first, second = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(first + damaged + second)
    again = Table(tmp_path / "out", campaign)
    assert set(again.rows) == {1, 2}
    again.add([row(3)])
    assert [json.loads(line)["run"] for line in path.read_text(encoding="utf-8").splitlines()] == [1, 2, 3]


def test_a_row_with_a_kind_of_failure_that_nobody_knows_is_refused_with_the_remedy(tmp_path):
    campaign = load_campaign(campaign_file(tmp_path / "a.yaml", DRAWN))
    table = Table(tmp_path / "out", campaign)
    older = {"kind": "extern arrow", "name": "perception.zed_status OK -> BROKEN", "answered_by": "x", "after_s": None}
    table.add([row(1), row(2, failures=[older])])
    table.finish()
    with pytest.raises(AnalysisError, match=r"run 2 has a failure of the kind `extern arrow`; .*, extern transition\. Go on"):
        Table(tmp_path / "out", campaign)


def test_a_campaign_whose_plan_was_damaged_is_refused(tmp_path):
    campaign = load_campaign(campaign_file(tmp_path / "a.yaml", DRAWN))
    Table(tmp_path / "out", campaign)
    (tmp_path / "out" / "campaign.json").write_text("{", encoding="utf-8")
    with pytest.raises(AnalysisError, match="holds another campaign"):
        Table(tmp_path / "out", campaign)


def test_a_folder_that_goes_away_is_told_in_a_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("alula.cli.campaign.run", lambda *_: shutil.rmtree(tmp_path / "out"))
    path = campaign_file(tmp_path / "a.yaml", "faults: [[zed@3]]\n")
    assert main([str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said == f"alula campaign: {tmp_path / 'out'}: can't be written any more: No such file or directory\n"


@pytest.mark.long
def test_a_campaign_that_is_killed_goes_on_and_has_the_same_table_in_the_end(tmp_path):
    path, out = campaign_file(tmp_path / "a.yaml", DRAWN.replace("runs: 12", "runs: 14")), tmp_path / "out"
    words = [str(path), "--out", str(out), "--time", "0"]  # what is proved of the missions is asked elsewhere
    killed = subprocess.run([sys.executable, "-c", KILLED_AFTER_FIRST_ROWS, *words], capture_output=True, timeout=300, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert 0 < (out / ROWS).read_bytes().count(b"\n") < 14
    words = [sys.executable, "-m", "alula.cli.campaign", *words]
    assert subprocess.run(words, capture_output=True, timeout=300, check=False).returncode in {0, 1}
    runs = load_campaign(path).runs
    there = [json.loads(line) for line in (out / ROWS).read_text(encoding="utf-8").splitlines()]
    assert [one["run"] for one in there] == list(range(14))
    assert there == json.loads(json.dumps(rows_of(runs, MOCKS, (), "")))
    assert [asdict(run)["seed"] for run in runs] == [one["seed"] for one in there]
    for name in ("coverage.json", "coverage.txt", "coverage.html"):
        assert (out / name).is_file()
    assert all(one["conforms"] for one in there)
