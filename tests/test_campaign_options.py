"""A campaign's `options` reach the live runs that it starts, through the command line as a user has it."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
CAMPAIGN = "about: two runs in the simulator\nover: simulator\nscenarios: [mapping]\nfaults: [[], [zed@30]]\nat_once: 1\n"


def campaign(folder: Path, options: str) -> subprocess.CompletedProcess[str]:
    file = folder / "campaign.yaml"
    file.write_text(f"{CAMPAIGN}options: {options}\n", encoding="utf-8")
    command = [ALULA_ROOT / "alula", "campaign", file, "--out", folder / "out"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("ALULA_")}
    return subprocess.run(command, cwd=ALULA_ROOT, env=environment, capture_output=True, text=True, check=False)


# A value that the run itself refuses, before it starts anything: only the run knows why.
@pytest.mark.parametrize(
    ("options", "refused"),
    [
        ("{rate: 100000}", "--rate 100000: must be 0 (no limit) or a positive factor up to 1000"),
        ("{imperfections: wind=x}", "--imperfections: "),
        ("{rate: 2, sensors: simulated}", "--sensors is for a real autopilot; add --autopilot URL"),
    ],
)
def test_each_run_gets_the_options(options: str, refused: str, tmp_path: Path) -> None:
    done = campaign(tmp_path, options)
    rows = [json.loads(line) for line in (tmp_path / "out/runs.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [(row["faults"], row["exit_code"], row["outcome"]) for row in rows] == [([], 2, "not_started"), (["zed@30"], 2, "not_started")]
    assert all(refused in row["reason"] for row in rows), (rows, done.stderr)


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        ("{rat: 2}", "the robot has no option --rat; it declares --rate"),
        ("{record: everything}", "--record: there is no 'everything'; there are functional, sensors"),
    ],
)
def test_what_the_robot_does_not_declare_is_refused_before_any_run(options: str, refused: str, tmp_path: Path) -> None:
    done = campaign(tmp_path, options)
    assert done.returncode == 2
    assert f"`options`: {refused}" in done.stderr
    assert not (tmp_path / "out").exists()
