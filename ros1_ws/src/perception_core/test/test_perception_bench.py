"""The bench of the perception nodes runs and writes its figures."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo

from perception_bench.broken_clouds import CLOUDS, SweepInTime
from perception_bench.broken_pictures import PICTURES, PairInTime
from perception_bench.run import main
from perception_core import NS, Sweep
from perception_core.testing import box_cloud, wall_pair
from zed_depth import StereoPair

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


@cache
def small_pairs() -> list[StereoPair]:
    return [StereoPair(NS + k * NS // 10, *(image[:96, :160] for image in wall_pair(8.0, seed=k))) for k in range(15)]


def broken_pairs(kind) -> list[StereoPair]:
    pairs = small_pairs()
    rng = np.random.default_rng(0)
    return [kind.pair(PairInTime(pairs, number, 12, rng)) for number in (12, 13)]


def told_infos(kind) -> dict[str, CameraInfo]:
    K, P = [240.0, 0.0, 240.0, 0.0, 240.0, 135.0, 0.0, 0.0, 1.0], [240.0, 0.0, 240.0, 0.0, 0.0, 240.0, 135.0, 0.0, 0.0, 0.0, 1.0, 0.0]  # noqa: N806
    right = [*P[:3], -28.8, *P[4:]]
    return kind.infos({"left": CameraInfo(width=480, height=270, K=K, P=P), "right": CameraInfo(width=480, height=270, K=K, P=right)})


def test_a_hundred_and_twenty_kinds_of_pictures_are_broken_each_in_its_way_and_always_alike() -> None:
    assert len({(kind.name, kind.parameter) for kind in PICTURES}) == len(PICTURES) == 120
    good = replace(PICTURES[0], pair=lambda moment: moment.pair)
    plain = broken_pairs(good), told_infos(good)
    for kind in PICTURES:
        assert kind.causes, kind.name
        pairs, again = broken_pairs(kind), broken_pairs(kind)
        for pair, same in zip(pairs, again, strict=True):
            assert pair.left.shape == pair.right.shape == (96, 160)
            assert pair.left.dtype == pair.right.dtype == np.uint8
            assert np.array_equal(pair.left, same.left), kind.name
            assert np.array_equal(pair.right, same.right), kind.name
        changed = any(
            one.stamp_ns != other.stamp_ns or not (np.array_equal(one.left, other.left) and np.array_equal(one.right, other.right))
            for one, other in zip(pairs, plain[0], strict=True)
        )
        assert changed != (str(told_infos(kind)) != str(plain[1])), kind.name


def broken_sweeps(kind) -> list[Sweep]:
    points = [box_cloud((5.0, 0.0, 0.0), seed=k) for k in range(15)]
    sweeps = [Sweep(NS + k * NS // 10, each, np.linspace(0.0, 0.1, len(each), dtype=np.float32)) for k, each in enumerate(points)]
    rng = np.random.default_rng(0)
    ahead, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    return [kind.sweep(SweepInTime(sweeps, number, 12, rng, ahead, up)) for number in (12, 13)]


def test_a_hundred_and_ten_kinds_of_clouds_are_broken_each_in_its_way_and_always_alike() -> None:
    assert len({(kind.name, kind.parameter) for kind in CLOUDS}) == len(CLOUDS) == 110
    plain = broken_sweeps(replace(CLOUDS[0], sweep=lambda moment: moment.sweep))
    for kind in CLOUDS:
        assert kind.causes, kind.name
        sweeps, again = broken_sweeps(kind), broken_sweeps(kind)
        for sweep, same in zip(sweeps, again, strict=True):
            assert len(sweep.points) == len(sweep.times_s)
            assert np.array_equal(sweep.points, same.points, equal_nan=True), kind.name
        changed = any(
            one.stamp_ns != other.stamp_ns
            or not np.array_equal(one.points, other.points, equal_nan=True)
            or not np.array_equal(one.times_s, other.times_s, equal_nan=True)
            for one, other in zip(sweeps, plain, strict=True)
        )
        assert changed != (kind.frame != "lidar"), kind.name


@pytest.mark.long
def test_what_a_kind_makes_of_the_way_ahead_is_told(tmp_path, capsys) -> None:
    assert main(["--breaks", "pictures", "clouds", "--case", "frame_id", "--json", str(tmp_path / "breaks.json")]) == 0
    (row,) = json.loads((tmp_path / "breaks.json").read_text())
    assert (row["kind"], row["seen"], row["consequence"], row["told_rightly"]) == ("frame_id unknown", "all", False, True)
    assert "clouds: 1 kinds; known within 1 s in all 1, in some 0, in none 0; missed with a consequence 0; cause right 1 of 1" in (
        capsys.readouterr().out
    )
