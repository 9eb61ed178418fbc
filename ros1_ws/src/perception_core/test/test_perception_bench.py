"""The bench of the perception nodes runs and writes its figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from perception_bench.run import main

LANE = """
name: lane
home: [0.0, 0.0, 0.0]
route: [[0.0, 0.0, 2.0], [6.0, 0.0, 2.0]]
keep_clear_m: 2.0
ground: {x: [-8.0, 20.0], y: [-8.0, 8.0]}
boxes:
  - {name: left wall, low: [-5.0, 3.0, 0.0], high: [14.0, 3.3, 4.0]}
  - {name: right wall, low: [-5.0, -3.3, 0.0], high: [14.0, -3.0, 4.0]}
  - {name: end, low: [14.0, -3.3, 0.0], high: [14.3, 3.3, 4.0]}
  - {name: start, low: [-5.3, -3.3, 0.0], high: [-5.0, 3.3, 4.0]}
"""


def test_a_case_is_measured_against_the_bare_library(tmp_path, capsys) -> None:
    assert main(["--case", "lidar 30", "--frames", "2", "--json", str(tmp_path / "figures.json")]) == 0
    (row,) = json.loads((tmp_path / "figures.json").read_text())["cases"]
    assert row["case"] == "lidar 30,000 points"
    assert row["peak_mb"] > 0
    for name in ("node", "bare reading"):
        assert 0 < row[name]["cpu_p50_ms"] <= row[name]["cpu_p95_ms"]
    assert "lidar 30,000 points" in capsys.readouterr().out


def test_an_unknown_case_is_told(capsys) -> None:
    assert main(["--case", "radar"]) == 2
    assert "no case begins with 'radar'; there are ['stereo 480x270" in capsys.readouterr().err


@pytest.mark.parametrize(("flight", "complaint"), [("yard", "expected WORLD:SEED, as in yard:1"), ("moon:1", "there is no world 'moon'")])
def test_a_flight_that_can_not_be_rendered_is_told(flight, complaint, capsys) -> None:
    assert main(["--rendered", flight]) == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.long
def test_a_rendered_flight_is_good(tmp_path, capsys) -> None:
    world = tmp_path / "lane.yaml"
    world.write_text(LANE)
    assert main(["--rendered", f"{world}:1", "--imperfections", "realistic,position_drift=0.05", "--json", str(tmp_path / "f.json")]) == 0
    rows = {row["sensor"]: row for row in json.loads((tmp_path / "f.json").read_text())}
    assert {sensor: (row["false_alarms"], row["not_ok"]) for sensor, row in rows.items()} == {"zed": (0, 0), "lidar": (0, 0)}
    assert rows["zed"]["measurements"] == rows["lidar"]["measurements"] > 100
    assert "lane.yaml, seed 1, realistic" in capsys.readouterr().out


def test_a_recorded_flight_is_judged_without_a_false_alarm_and_faults_are_found(tmp_path, capsys) -> None:
    bag = Path(__file__).resolve().parents[4] / "tests" / "recordings" / "mapping-sensors" / "functional.bag"
    assert main(["--recording", str(bag), "--times", "1", "--json", str(tmp_path / "figures.json")]) == 0
    rows = json.loads((tmp_path / "figures.json").read_text())
    flights = {row["sensor"]: row for row in rows if "fault" not in row}
    assert {sensor: (row["measurements"], row["false_alarms"], row["not_ok"]) for sensor, row in flights.items()} == {
        "zed": (136, 0, 0),
        "lidar": (136, 0, 0),
    }
    faults = {row["fault"]: row for row in rows if row.get("sensor") == "zed" and "fault" in row}
    assert len(faults) == 13
    assert {name for name, row in faults.items() if row["missed"] or not row["found"]} == set()
    # The recording's images are 240 px wide: a turn of 1 degree is 2 px at their edge, which is at the limit of what is looked for.
    assert {name for name, row in faults.items() if row["free_told_free"]} <= {"rotated"}
    assert "mapping-sensors, zed: 0.5 minutes, 136 measurements, 0 false alarms" in capsys.readouterr().out
