"""The library on a machine without ROS: installed by pip into an empty environment, it does all that the README promises of a laptop."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
ALLOWED = {"PATH": "/usr/bin:/bin", "LANG": "C.UTF-8"}
NO_ROS = "import importlib.util as u, sys; sys.exit(any(u.find_spec(name) for name in ('rclpy', 'rospy', 'open3d')))"
Alula = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def alula(tmp_path_factory: pytest.TempPathFactory) -> Alula:
    """Install the library as a user does; return what runs its command in the drone's folder, with nothing of this environment."""
    place = tmp_path_factory.mktemp("laptop")
    source = shutil.copytree(ALULA_ROOT / "lib", place / "lib", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "build", "test"))
    python = os.environ.get("ALULA_PYTHON", "/usr/bin/python3")
    subprocess.run([python, "-m", "venv", str(place / "venv")], check=True, env={**os.environ, **ALLOWED})
    pip = [str(place / "venv/bin/pip"), "--disable-pip-version-check", "install", "--quiet", "--no-compile", f"{source}[all]"]
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ROS", "AMENT", "ALULA", "LD_"))}
    done = subprocess.run(pip, env={**inherited, **ALLOWED}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    subprocess.run([str(place / "venv/bin/python"), "-c", NO_ROS], check=True, env=ALLOWED)

    def run(*words: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        command = [str(place / "venv/bin/alula"), *words]
        environment = {**ALLOWED, "HOME": str(place), "MPLCONFIGDIR": str(place)}
        done = subprocess.run(command, cwd=ALULA_ROOT, env=environment, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == code, done.stdout[-2000:] + done.stderr[-2000:]
        return done

    return run


@pytest.fixture(scope="module")
def flown(alula: Alula, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "run"
    said = alula("run", "mapping", "--mock", "--fail", "zed@30", "--monitor", "--out", str(out))
    assert said.stdout.startswith("\nmission accomplished in degraded mode")
    return out


def test_a_mission_runs_over_mocks_with_its_report(flown: Path) -> None:
    summary = json.loads((flown / "summary.json").read_text(encoding="utf-8"))
    assert (summary["outcome"], summary["landed"], summary["conformance"]["conforms"]) == ("degraded", True, True)
    assert summary["recovery"]["detected_s"] - summary["recovery"]["failure_s"] < 1.0
    assert [one["answered_by"] for one in summary["answers"]] == ["LiDAR navigation"]
    for name in ("report.html", "timeline.svg", "tree.svg", "skills.mcap"):
        assert (flown / name).stat().st_size > 1000, name
    assert summary["problems"] == []


def test_its_decisions_are_made_again(alula: Alula, flown: Path) -> None:
    assert "all as they were" in alula("replay", str(flown)).stderr
    assert "now:" in alula("replay", str(flown), "--fail", "lidar@40", code=1).stderr


def test_its_record_is_held_against_models_and_expectations(alula: Alula, flown: Path, tmp_path: Path) -> None:
    alula("conform", str(flown))
    expected = tmp_path / "expect.yaml"
    expected.write_text(alula("expect", str(flown)).stdout, encoding="utf-8")
    alula("expect", str(flown), "--check", str(expected))
    other = tmp_path / "other"
    alula("run", "mapping", "--mock", "--out", str(other))
    alula("expect", str(other), "--check", str(expected), code=1)
    assert "differs: interrupt navigation.goto_straight at 30." in alula("compare", str(flown), str(other), code=1).stdout


def test_models_are_checked_and_proved(alula: Alula) -> None:
    models = sorted(str(path) for path in (ALULA_ROOT / "skillsets/uav").glob("*.skill"))
    findings = json.loads(alula("check", "--json", *models).stdout)
    assert findings["exit_code"] == 0


def test_a_campaign_runs_over_mocks(alula: Alula, tmp_path: Path) -> None:
    plan = tmp_path / "few.yaml"
    draw = "{faults: {mapping: [zed]}, most: 1, at_s: [5, 60], lasts_s: [5, 30]}"
    plan.write_text(f"over: mocks\nscenarios: [mapping]\nruns: 5\ndraw: {draw}\n", encoding="utf-8")
    said = alula("campaign", str(plan), "--out", str(tmp_path / "campaign"), code=0)
    assert "5 runs" in said.stdout + said.stderr


def test_what_needs_ros_says_so(alula: Alula) -> None:
    assert "needs an installation with ROS" in alula("run", "mapping", code=2).stderr
    assert "needs an installation with ROS" in alula("fly", "mapping", code=2).stderr
    for name in ("test", "panel", "setup", "bench"):
        said = alula(name, code=2).stderr
        assert said.startswith(f"alula: {name}: ")
        assert "use its entry script ./alula" in said
    assert alula("completion", "zsh").stdout.startswith("#compdef alula")
    assert sys.version_info >= (3, 11)
