"""A campaign's responses to failures beside the proved ones: those of real flights are known, those of another tree are errors."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("z3")

from alula.campaign.beside import NOTHING, MissionResponses, beside
from alula.campaign.coverage import Coverage
from alula.campaign.flown import FlownResponse
from alula.campaign.mocked_scenarios import load_mocked_scenario
from alula.campaign.plan import MOCKS, PlannedRun
from alula.campaign.proved import ProvedMission, proved
from alula.campaign.rendering import as_page, as_text
from alula.campaign.rows import rows_of
from alula.cli.campaign import main
from alula.common.scenarios import load_scenario
from alula.records.causes.fault_file import effects_of_robot
from alula.records.models import robot_skillsets

ROOT = Path(__file__).resolve().parents[3]
FAULTS = """
scenarios: [mapping]
runs: 40
seed: 5
draw: {faults: [zed, lidar, pilot, slam], most: 2, at_s: [0, 60], lasts_s: [5, 20]}
behaviour: failing.yaml
"""
WATCH = ("mapping mission", "map the area", "fly and map", "navigate", "ZED navigation", "with the ZED", "watch with the ZED")


def campaign(folder: Path, out: str = "out") -> int:
    """Do one in a folder."""
    shutil.copy(ROOT / "tests/campaigns/uav-failing.yaml", folder / "failing.yaml")
    (folder / "campaign.yaml").write_text(FAULTS, encoding="utf-8")
    return main([str(folder / "campaign.yaml"), "--out", str(folder / out), "--time", "1e6"])


def another_robot(folder: Path) -> Path:
    """Make the drone with another mission: one that has no branch for the LiDAR."""
    for path in ROOT.iterdir():
        if path.name != "missions":
            (folder / path.name).symlink_to(path)
    shutil.copytree(ROOT / "missions", folder / "missions")
    mission = folder / "missions/mapping.xml"
    text, found = re.subn(r' *<SubTree ID="lidar_navigation" [^>]*/>\n', "", mission.read_text(encoding="utf-8"))
    assert found == 1
    mission.write_text(text, encoding="utf-8")
    return folder


@pytest.mark.long
def test_all_responses_of_flights_are_proved_and_those_of_another_tree_are_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert campaign(tmp_path) == 0, capsys.readouterr().err
    said = capsys.readouterr()
    told = json.loads((tmp_path / "out/coverage.json").read_text(encoding="utf-8"))
    (mission,) = told["answers"]
    assert (mission["scenario"], mission["unproved"], mission["unknown"]) == ("mapping", "", [])
    flown = [one for one in mission["rows"] if one["flown"]["times"]]
    assert len(flown) >= 8
    assert len(mission["rows"]) > 30
    watch = {tuple(one["while"]): one for one in flown if one["skill"] == "perception.zed_depthmap"}
    one = watch["mapping.lidar_mapping", "navigation.goto_straight"]
    assert one["proved"]["asks"] == ["LiDAR navigation: 'watch with the LiDAR'", "given up: 'hover'", NOTHING]
    assert {"zed", "zed_depth"} <= set(one["proved"]["faults"])
    assert "pilot" not in one["proved"]["faults"]
    assert set(one["flown"]["faults"]) == {"zed"}
    assert "'watch with the ZED' (perception.zed_depthmap) fails while mapping.lidar_mapping, navigation.goto_straight ran" in said.out
    page = (tmp_path / "out/coverage.html").read_text(encoding="utf-8")
    assert "Each flown response is one of the proved ones." in page
    assert "not proved" not in page

    # The same table, and the proof of another tree.
    (tmp_path / "robot").mkdir()
    monkeypatch.setenv("ALULA_ROBOT", str(another_robot(tmp_path / "robot")))
    assert campaign(tmp_path) == 1
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("alula campaign: ")]
    (line,) = [
        one for one in lines if "(perception.zed_depthmap) ended with zed_ok" in one and "goto_straight ran" in one and "degraded" in one
    ]
    pattern = (
        r"alula campaign: mapping, run \d+: 'watch with the ZED' \(perception\.zed_depthmap\) ended with zed_ok, by the fault zed "
        r"while mapping\.lidar_mapping, navigation\.goto_straight ran; flown: LiDAR navigation: 'watch with the LiDAR', then degraded"
        r"(, \d+ times)?; proved: given up: 'hover' or nothing more, then given_up"
    )
    assert re.fullmatch(pattern, line), line
    page = (tmp_path / "out/coverage.html").read_text(encoding="utf-8")
    assert "not proved: LiDAR navigation: &#x27;watch with the LiDAR&#x27;" in page
    assert "not proved: degraded" in page


def test_a_response_is_what_the_tree_asked_for_in_the_tick_that_saw_the_failure() -> None:
    (row,) = rows_of([PlannedRun(0, "mapping", 0, ("zed@10",))], MOCKS, (), "")
    (told,) = row["answers"]
    assert (told["fault"], 10.3 < told["at_s"] < 10.4) == ("zed", True)
    one = FlownResponse.read(json.loads(json.dumps(told)))
    assert (one.place, one.skill, one.state, one.result) == (
        WATCH,
        "perception.zed_depthmap",
        "RESOURCE_INVARIANT_VIOLATED",
        "zed_ok",
    )
    assert one.moment == ("mapping.lidar_mapping", "navigation.goto_straight")
    assert [place[-1] for place in one.asked] == ["watch with the LiDAR"]


def test_a_mission_that_asks_for_nothing_more_has_a_response_without_skills() -> None:
    row = load_mocked_scenario("mapping").run(PlannedRun(0, "mapping", 0, ("pilot@10",)).requests)
    assert [(one.result, one.asked) for one in row.responses] == [("keep_sdk_authority", ())]


def responses_of(mission: ProvedMission) -> MissionResponses:
    return beside("mapping", mission, rows_of([PlannedRun(0, "mapping", 0, ("zed@10",))], MOCKS, (), ""))


def test_a_proof_that_is_not_whole_makes_no_error() -> None:
    assert len(responses_of(ProvedMission()).unknown) == 1
    responses = responses_of(proved(load_scenario("mapping"), robot_skillsets(), effects_of_robot(), print, 0.0))
    assert responses.unproved == "not all runs were looked at in 0 s"
    assert responses.unknown == []
    coverage = Coverage([], 1, {"degraded": 1}, [], [responses])
    assert coverage.unknown == []
    assert "not all runs were looked at" in as_text(coverage)
    assert "<p class=" not in as_page(coverage, "one flight")


def test_a_mission_that_is_no_file_is_not_proved() -> None:
    scenario = load_scenario("mapping")
    python = replace(scenario, mission="a.module:function")
    assert proved(python, [], effects_of_robot(), print, 1.0).unproved == "a.module:function is no file of a tree"


def test_an_aborted_mission_is_not_held_against_a_proof() -> None:
    (row,) = rows_of([PlannedRun(0, "mapping", 0, ("zed@10",))], MOCKS, (), "")
    assert beside("mapping", ProvedMission(), [{**row, "outcome": "aborted"}]).rows == []
