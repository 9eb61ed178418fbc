"""A campaign over the simulator, with a recorded flight in its place: what is asked of ``alula run``, and what its folders become."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
import yaml
from campaign_mocks import fly_recorded

from alula.campaign.live import words_of_run
from alula.campaign.plan import SIMULATOR, PlannedRun, load_campaign
from alula.campaign.rows import rows_of
from alula.campaign.running import offer_of
from alula.cli.campaign import check_faults
from alula.common.record import FILE, MISSION, RecordWriter
from alula.common.scenarios import load_scenario
from alula.records.errors import AnalysisError

ALULA_ROOT = Path(os.environ["ALULA_ROOT"])
CAMPAIGNS = ALULA_ROOT / "tests/campaigns"
SUMMARY = """{"outcome": "degraded", "reason": "zed", "landed": true, "collisions": 0, "min_clearance_m": 1.2, "problems": [],
 "skills": [{"id": "a", "end_s": 3.0}, {"id": "b", "end_s": null}], "died": [{"name": "zed_depth", "when_s": 7.0, "how": "exit code 1"}]}"""
FLY = """#!/bin/sh
echo "$@" >>"$(dirname "$0")/asked"
while [ "$1" != --out ]; do [ "$1" = 13 ] && { echo "no free domain" >&2; exit 2; }; shift; done
mkdir -p "$2" && cp "$RECORDING/skills.mcap" "$2" && cp "$(dirname "$0")/summary.json" "$2"
"""


@pytest.fixture
def recorded_flights(tmp_path, monkeypatch):
    """An ``alula`` that leaves a recorded flight whatever it is to fly; seed 13 can't start."""
    (tmp_path / "alula").write_text(FLY, encoding="utf-8")
    (tmp_path / "alula").chmod(0o755)
    (tmp_path / "summary.json").write_text(SUMMARY, encoding="utf-8")
    (tmp_path / "recorded").mkdir()
    fly_recorded(tmp_path / "recorded", "zed@6")
    monkeypatch.setenv("ALULA_ROOT", str(tmp_path))
    monkeypatch.setenv("RECORDING", str(tmp_path / "recorded"))
    return tmp_path


def test_a_flight_of_the_simulator_becomes_a_row_and_keeps_its_folder(recorded_flights, tmp_path):
    flights = [PlannedRun(4, "mapping", 7, ("zed@6", "lidar@9"), tmp_path / "hill.yaml"), PlannedRun(5, "mapping", 13, ())]
    (tmp_path / "out" / "run-00004").mkdir(parents=True)
    row, failed = rows_of(flights, SIMULATOR, (), str(tmp_path / "out"), ("--rate", "0"))
    asked = (tmp_path / "asked").read_text(encoding="utf-8").splitlines()
    folder = tmp_path / "out" / "run-00004-2"  # what a crash has left half done stays as it is
    assert asked[0] == f"run mapping --seed 7 --world {tmp_path / 'hill.yaml'} --fail zed@6 --fail lidar@9 --rate 0 --out {folder}"
    assert (folder / "skills.mcap").is_file()
    assert row["folder"] == folder.name
    found = (row["outcome"], row["landed"], row["collisions"], row["min_clearance_m"], row["open"], row["exit_code"], row["conforms"])
    assert found == ("degraded", True, 0, 1.2, ["b"], 0, True)
    answers = {failure["name"]: failure["answered_by"] for failure in row["failures"]}
    assert answers["zed"] == answers["perception.zed_status OK -> BROKEN"] == "LiDAR navigation"
    assert answers["lidar"] == answers["zed_depth"] == "not detected"
    assert (failed["outcome"], failed["reason"], failed["exit_code"], failed["failures"]) == ("not_started", "no free domain", 2, [])


def test_managers_that_died_are_answered_by_what_the_mission_was_told(recorded_flights, tmp_path):
    shutil.rmtree(recorded_flights / "recorded")
    (recorded_flights / "recorded").mkdir()
    mission = fly_recorded(recorded_flights / "recorded", kill=("perception", 20.0))
    lift_off_s = mission.departure_s
    died = [{"name": name, "when_s": 20.0 - lift_off_s, "how": "signal SIGKILL"} for name in ("perception", "lidar_mapping")]
    summary = {"outcome": "given_up", "reason": "the managers have gone", "landed": True, "skills": [], "died": died}
    (recorded_flights / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    (row,) = rows_of([PlannedRun(4, "mapping", 7, ())], SIMULATOR, (), str(tmp_path / "out"))
    answers = {one["name"]: (one["answered_by"], one["skill"]) for one in row["failures"] if one["kind"] == "process"}
    assert answers == {"perception": ("given up", "navigation.hover"), "lidar_mapping": ("not detected", "not detected")}
    assert row["conforms"] is True


def test_a_flight_in_which_no_skill_was_started_keeps_its_own_reason(recorded_flights, tmp_path):
    summary = {"outcome": "not_started", "reason": "the mission clock stands still", "landed": None, "problems": ["no lift-off is known"]}
    (recorded_flights / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    writer = RecordWriter(recorded_flights / "recorded" / FILE)
    writer.write(MISSION, 0, {"scenario": "inspection"})
    writer.close()
    (row,) = rows_of([PlannedRun(4, "inspection", 7, ())], SIMULATOR, (), str(tmp_path / "out"))
    assert {name: row[name] for name in summary} == summary
    assert (row["events"], row["failures"]) == (0, [])


DRAWN = ["uav-simulator.yaml", "uav-simulator-short.yaml"]
"""The drone's drawn campaigns."""
NOT_THERE = {"mapping": {"camera"}, "inspection": set()}
"""What a scenario has not, of what can fail in all of them."""


@pytest.mark.parametrize("file", DRAWN)
def test_three_hundred_flights_are_drawn_of_all_that_can_fail(file):
    campaign = load_campaign(CAMPAIGNS / file)
    offer = offer_of(campaign)
    check_faults(campaign, offer)
    assert {flight.world is None for flight in campaign.runs} == {file == "uav-simulator.yaml"}
    assert (campaign.over, campaign.at_once, len(campaign.runs)) == (SIMULATOR, 1, 300)
    assert {len(flight.faults) for flight in campaign.runs} == {1, 2, 3}
    for name in ("inspection", "mapping"):
        scenario = load_scenario(name)
        # A motor of six that stops is a crash whatever the mission does.
        things = {**offer.faults, **dict(scenario.faults)}.keys() - NOT_THERE[name] - {"motor"}
        faults = [fault for flight in campaign.runs if flight.scenario == name for fault in flight.requests]
        assert {fault.what for fault in faults} == things
        stopped = {fault.what for fault in faults if fault.how == "hung" and round((fault.end_s or 0.0) - fault.begin_s, 6) == 5.0}
        assert stopped <= dict(scenario.processes).keys()
        assert len(stopped) > 5


@pytest.mark.parametrize("file", DRAWN)
def test_a_drawn_campaign_names_every_way_of_all_that_can_fail(file):
    document = yaml.safe_load((CAMPAIGNS / file).read_text(encoding="utf-8"))
    offer = offer_of(load_campaign(CAMPAIGNS / file))
    for name, entries in document["draw"]["faults"].items():
        kinds = {kind if isinstance(kind, str) else next(iter(kind)) for entry in entries for kind in entry}
        known = {**offer.faults, **dict(load_scenario(name).faults)}
        assert kinds == {f"{what}:{how}" for what, ways in known.items() if what not in NOT_THERE[name] | {"motor"} for how in ways}


@pytest.mark.parametrize("scenario", ["inspection", "mapping"])
def test_a_campaign_that_lists_its_faults_may_name_every_process_of_a_flight(scenario, tmp_path):
    known = load_scenario(scenario)
    faults = [f"{process}:{how}@3" for process in dict(known.processes) for how in dict(known.faults)[process]]
    assert {"uav_guidance:killed@3", "ros_bridge:hung@3"} <= set(faults)
    file = tmp_path / "c.yaml"
    file.write_text(yaml.safe_dump({"over": SIMULATOR, "scenarios": [scenario], "faults": [[one] for one in faults]}), encoding="utf-8")
    campaign = load_campaign(file)
    check_faults(campaign, offer_of(campaign))
    assert [words_of_run(planned)[-2:] for planned in campaign.runs] == [["--fail", one] for one in faults]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("zet@3", "the scenario mapping: fault 'zet@3': there is no 'zet' to break; choose one of "),
        ("zed:frozzen@3", "the scenario mapping: fault 'zed:frozzen@3': zed can't be 'frozzen'; choose one of "),
        ("radio:out@3", "the scenario mapping: fault 'radio:out@3': there is no 'radio' to break"),
        ("uav_guidanc:killed@3", "the scenario mapping: fault 'uav_guidanc:killed@3': there is no 'uav_guidanc' to break; choose one of "),
        (
            "uav_guidance:dead@3",
            "the scenario mapping: fault 'uav_guidance:dead@3': uav_guidance can't be 'dead'; choose one of killed, hung",
        ),
    ],
)
def test_a_fault_that_a_flight_can_not_have_is_refused_before_the_first_one(fault, words, tmp_path):
    file = tmp_path / "c.yaml"
    file.write_text(f"over: simulator\nscenarios: [mapping]\nfaults: [[zed@3], ['{fault}']]\n", encoding="utf-8")
    campaign = load_campaign(file)
    with pytest.raises(AnalysisError) as refused:
        check_faults(campaign, offer_of(campaign))
    assert str(refused.value).startswith(words)
