"""A mission of two robots, over mocks: examples/two_robots names the drone and the rover, which know nothing of each other."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
FLEET = ALULA_ROOT / "examples/two_robots"


def command(module: str, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "ALULA_ROBOT": str(FLEET)}
    command = [str(ALULA_ROOT / "setup/in_ros2"), "python", "-m", f"alula.commands.{module}", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def run(out: Path, code: int, *words: str) -> dict[str, Any]:
    done = command("run", "meet", "--mock", "--out", str(out), *words)
    assert done.returncode == code, done.stdout + done.stderr
    assert (out / "report.html").is_file()
    return dict(json.loads((out / "summary.json").read_text(encoding="utf-8")))


def skills(summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    ordered = sorted(summary["skills"], key=lambda one: float(one["start_s"]))
    return [(one["skillset"], one["skill"], one["result"] or one["outcome"]) for one in ordered]


def test_the_rover_is_sent_to_where_the_drone_landed(tmp_path: Path) -> None:
    summary = run(tmp_path / "run", 0)
    assert (summary["outcome"], summary["problems"]) == ("accomplished", [])
    done = skills(summary)
    assert done[2:5] == [
        ("drone_navigation", "takeoff", "AT_ALTITUDE"),
        ("drone_navigation", "goto_straight", "ARRIVED"),
        ("drone_navigation", "land", "LANDED"),
    ]
    assert done[5:] == [("rover_perception", "scan", "INTERRUPTED"), ("rover_base", "drive_to", "ARRIVED")]
    replay = command("replay", str(tmp_path / "run"))
    assert replay.returncode == 0, replay.stdout + replay.stderr


@pytest.mark.parametrize(
    ("fault", "failed"),
    [
        ("drone_zed@5", ("drone_perception", "zed_depthmap", "zed_ok")),
        ("rover_laser@3", ("rover_perception", "scan", "works")),
    ],
)
def test_what_fails_of_one_robot_ends_the_mission_of_both_in_order(fault: str, failed: tuple[str, str, str], tmp_path: Path) -> None:
    summary = run(tmp_path / "run", 1, "--fail", fault)
    assert summary["outcome"] == "given_up"
    done = skills(summary)
    assert failed in done
    assert ("drone_navigation", "land", "LANDED") in done
    assert ("rover_base", "stop_here", "STANDING") in done
    assert ("rover_base", "drive_to", "ARRIVED") not in done


def test_the_mission_of_both_is_checked_and_drawn_by_their_models(tmp_path: Path) -> None:
    mission = str(FLEET / "missions/meet.xml")
    done = command("check", mission, "--no-proofs")
    assert (done.returncode, done.stdout) == (0, f"{mission}: ok\n"), done.stderr
    wrong = tmp_path / "wrong.xml"
    wrong.write_text(Path(mission).read_text(encoding="utf-8").replace("rover_base.drive_to", "rover_base.fly_to"), encoding="utf-8")
    done = command("check", str(wrong), "--no-proofs")
    assert done.returncode == 1
    assert "rover_base.fly_to" in done.stdout
    palette = command("palette", str(FLEET)).stdout
    assert '<Action ID="rover_base.drive_to">' in palette
    assert '<Action ID="drone_navigation.takeoff">' in palette
