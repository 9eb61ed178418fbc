"""A replay with a folder writes summary, pictures and page as a flight does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from alula.cli.replay import OTHERWISE

RECORDING = Path(os.environ["ALULA_ROOT"]) / "tests/recordings/mapping"


@pytest.mark.parametrize("on", [True, False])
def test_a_replay_leaves_what_a_flight_leaves(on, tmp_path):
    out = tmp_path / "changed"
    words = [sys.executable, "-m", "alula_flight.replay", str(RECORDING), "--fail", "zed@6", "--out", str(out), *(["--on"] if on else [])]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == OTHERWISE, done.stderr
    summary, timeline = (json.loads((out / f"{name}.json").read_text()) for name in ("summary", "timeline"))
    assert (summary["scenario"], summary["faults"], summary["seed"], summary["collisions"]) == ("mapping", ["zed@6"], None, None)
    assert summary["recovery"]["failure_s"] == 6.0
    assert summary["recovery"]["detected_s"] == 6.34
    told = (summary["outcome"], summary["landed"], summary["problems"])
    assert told == (("degraded", True, []) if on else ("running", False, ["the replay stopped before the mission's end"]))
    assert {row["skill"] for row in timeline["skills"]} >= {"goto_straight", "zed_depthmap"}
    for name in ("timeline.svg", "tree.svg"):
        ET.parse(out / name)  # noqa: S314 - our own
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "mapping, failing zed@6, replay of mapping" in page
    assert "DecompressionStream" in page
