"""A scenario added as docs/how-to/scenarios.md says: its files, taken from the page, in a copy of the checkout that is made of links."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from textwrap import dedent

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
PAGE = (ALULA_ROOT / "docs/how-to/scenarios.md").read_text(encoding="utf-8")
LIMIT_S = 250.0
OWN = ("setup", "scenarios", "missions", "ros1_ws")
"""What is no link: what is added to, and the folder above it; and the scripts that find the checkout by where they are."""


def block(number: int) -> str:
    """Return the indented block of a step of the page."""
    step = PAGE.partition(f"\n{number}. ")[2].partition(f"\n{number + 1}. ")[0]
    lines = [line for line in step.splitlines() if line.startswith("       ") or not line]
    return dedent("\n".join(lines)).strip() + "\n"


def link_all(source: Path, target: Path, *, but: str = "") -> None:
    """Link what is in a folder into another one."""
    target.mkdir(parents=True, exist_ok=True)
    for entry in source.iterdir():
        if entry.name != but:
            (target / entry.name).symlink_to(entry)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a checkout with the page's scenario in it; what was built is shared."""
    root = tmp_path_factory.mktemp("checkout")
    for entry in ALULA_ROOT.iterdir():
        if entry.name not in OWN and entry.name not in {".git", "runs"}:
            (root / entry.name).symlink_to(entry)
    shutil.copytree(ALULA_ROOT / "setup", root / "setup")
    shutil.copytree(ALULA_ROOT / "scenarios", root / "scenarios")
    shutil.copytree(ALULA_ROOT / "missions", root / "missions")
    link_all(ALULA_ROOT / "ros1_ws", root / "ros1_ws", but="src")
    link_all(ALULA_ROOT / "ros1_ws/src", root / "ros1_ws/src", but="uav_bringup")
    shutil.copytree(ALULA_ROOT / "ros1_ws/src/uav_bringup", root / "ros1_ws/src/uav_bringup")
    (root / "missions/patrol.xml").write_text(block(2), encoding="utf-8")
    launch = root / "ros1_ws/src/uav_bringup/launch"
    text = (launch / "mapping.launch").read_text(encoding="utf-8")
    for name in ("scenario", "skillsets"):
        wanted = next(part for part in PAGE.split("`") if part.startswith(f'<arg name="{name}" value="'))
        begin = text.index(f'<arg name="{name}" value="')
        text = text[:begin] + wanted + text[text.index("/>", begin) + 2 :]
    (launch / "patrol.launch").write_text(text, encoding="utf-8")
    (root / "scenarios" / "patrol.yaml").write_text(block(4), encoding="utf-8")
    return root


def run(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "PYTHON", "AMENT", "CMAKE", "LD_", "ALULA_"))}
    environment["ALULA_STATE"] = os.environ.get("ALULA_STATE", str(ALULA_ROOT / ".alula"))
    return subprocess.run(words, cwd=root, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False)


def test_the_scenario_of_the_page_flies_over_mocks(checkout: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    flown = run(checkout, "setup/in_ros2", "python", "-m", "alula.cli.run", "patrol", "--mock", "--out", str(out))
    assert flown.returncode == 0, flown.stdout + flown.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["scenario"], summary["outcome"], summary["landed"], summary["problems"]) == ("patrol", "accomplished", True, [])
    flights = [one["result"] for one in summary["skills"] if one["skill"] == "goto"]
    assert flights == ["ARRIVED"] * len(summary["mission"]["inputs"]["route"])
    assert {one["skillset"] for one in summary["skills"]} == {"navigation"}


def test_its_launch_file_starts_what_every_flight_needs(checkout: Path, tmp_path: Path) -> None:
    launch = "ros1_ws/src/uav_bringup/launch/patrol.launch"  # by its path: the workspace that is shared has the packages it was built of
    listed = run(checkout, "setup/in_ros1", "roslaunch", "--nodes", launch, f"out:={tmp_path}")
    assert listed.returncode == 0, listed.stderr
    assert {"/uav_simulator", "/uav_guidance"} <= set(listed.stdout.split())
