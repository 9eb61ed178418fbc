"""The rover of examples/, copied out of the checkout: it shares nothing with the drone; Alula can't be written to meanwhile."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from alula_testing.cover import read_only

ALULA_ROOT = Path(__file__).resolve().parents[1]
IN_ROS2 = str(ALULA_ROOT / "setup/in_ros2")


@pytest.fixture(scope="module")
def rover(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy; nothing is set up for it."""
    copy = tmp_path_factory.mktemp("elsewhere") / "rover"
    shutil.copytree(ALULA_ROOT / "examples/rover", copy, ignore=shutil.ignore_patterns(".alula", "runs", "__pycache__"))
    return copy


def run(rover: Path, *words: str) -> subprocess.CompletedProcess[str]:
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("ALULA_ROBOT", "PYTHONPATH", "PYTEST_ADDOPTS", "ROS_DOMAIN_ID"))}
    command = [*read_only(), "sh", "-c", 'cd "$1" && shift && exec "$@"', "sh", str(rover), IN_ROS2, "python", "-m", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, env={**kept, "ALULA_ROBOT": str(rover)})


def test_its_models_are_proved_and_its_missions_have_no_findings(rover: Path) -> None:
    missions = [f"missions/{name}.xml" for name in ("deliver", "patrol")]
    models = [str(path) for path in sorted((rover / "skillsets").iterdir()) if path.suffix in {".skill", ".rl"}]
    done = run(rover, "alula.commands.check", *models, *missions)
    assert done.returncode == 0, done.stdout + done.stderr
    # What a mission accepts is a note, and one that the time was over before all its runs were looked at.
    assert len(re.findall(r": ok(, 1 note|, 2 notes)?$", done.stdout, re.MULTILINE)) == len(models) + len(missions)
    assert set(re.findall(r"note (ALU\d+)", done.stdout)) <= {"ALU701", "ALU710"}


def test_the_laser_dies_and_it_reports_where_it_waits(rover: Path, tmp_path: Path) -> None:
    done = run(rover, "alula.commands.run", "deliver", "--mock", "--fail", "laser@30", "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert (summary["outcome"], summary["problems"]) == ("degraded", [])
    assert [one["result"] for one in summary["skills"] if one["skill"] == "creep"] == ["ARRIVED"]
    assert (tmp_path / "run/report.html").is_file()


def test_no_line_of_the_framework_names_it() -> None:
    places = ["lib/alula", "bridge", "flight", "setup", "ros1_ws/src/skillset_ros1", "ros2_ws/src/skillset_ros2"]
    pattern = r"examples/rover|rover_(robot|navigation|simulator|bringup)|move_base"
    command = ["grep", "-rlE", "--include=*.py", "--include=*.yaml", "--include=*.launch", "--include=*.sh", pattern, *places]
    found = subprocess.run(command, cwd=ALULA_ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    assert [line for line in found if "/test/" not in line] == []
