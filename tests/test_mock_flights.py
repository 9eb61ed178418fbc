"""Flights over mocks as a user makes them: the example of the page on mocks, the run's folder, and what can't be."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from xml.etree import ElementTree as ET

from alula.common import run_log
from alula.common.record import read_record
from alula_testing.flights import ALULA_ROOT, start_flight


def example(document: str, marker: str) -> str:
    """Return the indented block that follows a marker in a document."""
    lines = (ALULA_ROOT / document).read_text(encoding="utf-8").partition(marker)[2].splitlines()[1:]
    block = []
    for line in lines:
        if line and not line.startswith("    "):
            break
        block.append(line)
    return dedent("\n".join(block))


def test_the_behaviour_of_the_page_on_mocks_is_flown_as_it_says(tmp_path: Path) -> None:
    behaviour = tmp_path / "gust.yaml"
    behaviour.write_text(example("docs/reference/mocks.md", "`gust.yaml`:"), encoding="utf-8")
    flight = start_flight(tmp_path / "run", "--mock", "--monitor", "--behaviour", str(behaviour))
    flight.end(0)
    summary = flight.summary
    assert (summary["outcome"], summary["landed"], summary["problems"]) == ("degraded", True, [])
    straight = [e for e in summary["skills"] if e["skill"] == "goto_straight"]
    assert [(e["outcome"], e["result"]) for e in straight[2:]] == [("TERMINATED", "BLOCKED"), ("INTERRUPTED", "")]
    assert straight[2]["message"] == "something is in the way"
    (zed,) = [e for e in summary["skills"] if e["skill"] == "zed_depthmap"]
    assert (zed["outcome"], zed["end_s"]) == ("RESOURCE_INVARIANT_VIOLATED", 45.0)
    lidar, sideways = (next(e for e in summary["skills"] if e["skill"] == name) for name in ("lidar_depthmap", "goto"))
    assert 9.0 < sideways["start_s"] - lidar["running_s"] < 10.0
    assert summary["skills"][-1]["result"] == "LANDED"
    assert (summary["collisions"], summary["distance_m"], summary["map"]["points"], summary["bridge"]) == (None, None, None, None)
    assert summary["mock"]["factor"] > 1.0
    assert "times faster than the clock" in flight.words()
    assert (summary["conformance"]["conforms"], summary["conformance"]["events"]) == (True, len(flight.events()))
    assert f"monitor: all {len(flight.events())} events conform to the models" in flight.words()
    assert "DecompressionStream" in (flight.out / "report.html").read_text(encoding="utf-8")
    for name in ("timeline.svg", "tree.svg"):
        ET.parse(flight.out / name)  # noqa: S314 - our own
    timeline, run = (json.loads((flight.out / f"{name}.json").read_text()) for name in ("timeline", "run"))
    assert {row["skill"] for row in timeline["skills"]} >= {"goto_straight", "lidar_depthmap", "land"}
    assert run_log.account(flight.out, read_record(flight.out))["outcome"] == "degraded"
    assert run["mock"] is True
    assert len(flight.events()) > 50
    assert not (flight.out / "map.png").exists()


def test_the_picture_of_a_tree_is_drawn_by_a_flight_over_mocks(tmp_path: Path) -> None:
    """Else: copy the ``tree.svg`` of `alula run mapping --mock --fail zed@12` to ``docs/pictures/tree-zed-fails.svg``."""
    flight = start_flight(tmp_path / "run", "--mock", "--fail", "zed@12")
    flight.end(0)
    assert (flight.out / "tree.svg").read_text() == (ALULA_ROOT / "docs/pictures/tree-zed-fails.svg").read_text()


def test_a_behaviour_that_can_not_be_read_leaves_nothing_behind(tmp_path: Path) -> None:
    behaviour = tmp_path / "wrong.yaml"
    behaviour.write_text("skills:\n  navigation.land: {result: CRASHED}\n", encoding="utf-8")
    for more, complaint in (
        (["--behaviour", str(behaviour)], f"{behaviour}:2: navigation.land has no result CRASHED; it has LANDED, BLOCKED, ABORTED"),
        (
            ["--fail", "camera@3"],
            "there is no fault 'camera' in the behaviour; it has "
            "link:silent, zed, lidar, pilot, pilot:lands, pilot:stick, wind, control, link, barometer, gps, imu, barometer:wrong",
        ),
    ):
        flight = start_flight(tmp_path / "run", "--mock", *more)
        assert flight.process.wait(120.0) == 2
        assert flight.words().splitlines()[-1] == f"alula run: {complaint}"
        assert not flight.out.exists()


def test_the_python_example_of_the_page_on_mocks_runs(tmp_path: Path) -> None:
    code = "import navigation_managers.model as navigation\n" + example("docs/reference/mocks.md", "## From a test\n")
    code += '\nassert (handle.outcome, handle.message) == ("NOT_VALIDATED", "propellers are off")'
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
