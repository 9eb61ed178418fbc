"""A campaign over the simulator, with a recorded flight in its place: what is asked of ``fly``, and what its folders become."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from run_analysis_mocks import fly_recorded

from run_analysis.campaign.flying import fly
from run_analysis.campaign.plan import SIMULATOR, Flight, load_campaign

CAMPAIGN = Path(os.environ["ALULA_ROOT"]) / "tests/campaigns/uav-simulator.yaml"
SUMMARY = """{"outcome": "degraded", "reason": "zed", "landed": true, "collisions": 0, "min_clearance_m": 1.2, "problems": [],
 "skills": [{"id": "a", "end_s": 3.0}, {"id": "b", "end_s": null}], "died": [{"name": "zed_depth"}]}"""
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
    flights = [Flight(4, "mapping", 7, ("zed@6", "lidar@9")), Flight(5, "mapping", 13, ())]
    (tmp_path / "out" / "flight-00004").mkdir(parents=True)
    row, failed = fly(flights, SIMULATOR, (), str(tmp_path / "out"))
    asked = (tmp_path / "asked").read_text(encoding="utf-8").splitlines()
    folder = tmp_path / "out" / "flight-00004-2"  # what a crash has left half done stays as it is
    assert asked[0] == f"fly mapping --seed 7 --rate 0 --fail zed@6 --fail lidar@9 --out {folder}"
    assert (folder / "skills.mcap").is_file()
    found = (row["outcome"], row["landed"], row["collisions"], row["min_clearance_m"], row["open"], row["died"], row["conforms"])
    assert found == ("degraded", True, 0, 1.2, ["b"], ["zed_depth"], True)
    answers = {failure["name"]: failure["answered_by"] for failure in row["failures"]}
    assert answers["perception.zed_status OK -> BROKEN"] == "LiDAR navigation"
    assert (failed["outcome"], failed["reason"], failed["events"], failed["failures"]) == ("not_started", "no free domain", 0, [])


def test_the_campaign_of_thirty_flights_is_of_both_scenarios_and_of_failures_that_the_simulator_has():
    campaign = load_campaign(CAMPAIGN)
    assert (campaign.over, campaign.at_once, len(campaign.flights)) == (SIMULATOR, 1, 30)
    assert [flight.scenario for flight in campaign.flights].count("inspection") == 15
    assert {len(flight.faults) for flight in campaign.flights} == {0, 1, 2}
