"""The bench of the perception nodes runs and writes its figures."""

from __future__ import annotations

import json

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
