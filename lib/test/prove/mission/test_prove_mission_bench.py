"""`alula bench missions`: what it measures, and what it draws. How fast it is, no test says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("z3")
pytest.importorskip("py_trees")

from prove_bench import missions as bench
from prove_bench.growth import picture

ROOT = Path(__file__).resolve().parents[4]
A_DAY_S = 86400.0


@pytest.mark.parametrize("family", bench.FAMILIES)
def test_the_smallest_mission_of_each_kind_is_looked_at_to_its_end(family: str) -> None:
    row = bench.measure(family, str(bench.FAMILIES[family][1][0]), A_DAY_S)
    assert row["complete"]
    assert row["regions"]
    assert row["ticks"]


def test_a_mission_grows_by_its_size() -> None:
    small, large = (bench.measure("fetch", size, A_DAY_S) for size in ("1", "3"))
    assert large["leaves"] == 3 * int(str(small["leaves"]))
    assert int(str(large["regions"])) > int(str(small["regions"]))


def test_a_bound_is_told() -> None:
    assert not bench.measure("fetch", "1", 0.0)["complete"]


def test_the_mission_of_a_robot_is_measured(capsys: pytest.CaptureFixture[str]) -> None:
    path = ROOT / "missions" / "inspection.xml"
    assert bench.main(["--timeout", "0", "--one", "a robot", str(path)]) == 0
    row = json.loads(capsys.readouterr().out)
    assert (row["family"], row["size"], row["complete"]) == ("a robot", "inspection", False)


def test_the_picture_has_a_line_for_each_kind_and_shows_where_it_stops() -> None:
    rows = [
        {"family": "fetch", "leaves": 4, "cpu_s": 0.1, "complete": True},
        {"family": "fetch", "leaves": 8, "cpu_s": 0.3, "complete": True},
        {"family": "ring", "leaves": 5, "cpu_s": 60.0, "complete": False},
    ]
    drawn = picture(rows)
    assert drawn.count("<circle") == 3
    assert drawn.count('fill="white"/>') == 2  # the ground, and the point that was not searched to the end
    assert [name in drawn for name in (">fetch<", ">ring<")] == [True, True]
