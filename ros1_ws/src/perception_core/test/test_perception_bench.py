"""The bench of the perception nodes runs and writes its figures."""

from __future__ import annotations

import json
from pathlib import Path

from perception_bench.run import main


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
