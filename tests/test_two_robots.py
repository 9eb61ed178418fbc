"""Missions of several robots: examples/two_robots over mocks, whose robots know nothing of each other, and a fleet in simulators."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import psutil
import pytest

from alula.common.processes import processes_of_run
from alula.common.record import EVENTS, read_record
from alula.prove.limits import Deadline
from alula.repair.repairing import Question, Search
from alula.repair.subject import Subject
from repair_bench.cases import without_the_others_turn

ALULA_ROOT = Path(__file__).resolve().parents[1]
FLEET = ALULA_ROOT / "examples/two_robots"


def command(module: str, *words: str, fleet: Path = FLEET) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "ALULA_ROBOT": str(fleet)}
    command = [str(ALULA_ROOT / "setup/in_ros2"), "python", "-m", f"alula.cli.{module}", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def run(out: Path, code: int, *words: str, fleet: Path = FLEET) -> dict[str, Any]:
    done = command("run", "meet", "--mock", "--out", str(out), *words, fleet=fleet)
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
    assert done[0] == ("drone_navigation", "takeoff", "AT_ALTITUDE")
    assert done[3:5] == [("drone_navigation", "goto_straight", "ARRIVED"), ("drone_navigation", "land", "LANDED")]
    assert target(summary) == {"x": 6.0, "y": 5.4, "theta": 0.0}, "where it landed, in the rover's map"
    assert done[5:] == [("rover_perception", "scan", "INTERRUPTED"), ("rover_base", "drive_to", "ARRIVED")]
    replay = command("replay", str(tmp_path / "run"))
    assert replay.returncode == 0, replay.stdout + replay.stderr


def target(summary: dict[str, Any]) -> object:
    return next(one["inputs"]["target"] for one in summary["skills"] if one["skill"] == "drive_to")


def test_a_drone_without_a_camera_lands_where_it_is_and_the_rover_is_sent_there(tmp_path: Path) -> None:
    summary = run(tmp_path / "run", 0, "--fail", "drone_zed@4")
    assert summary["outcome"] == "degraded"
    done = skills(summary)
    assert ("drone_perception", "zed_depthmap", "zed_ok") in done
    assert done[-1] == ("rover_base", "drive_to", "ARRIVED")
    place = target(summary)
    assert isinstance(place, dict)
    assert 2.0 < place["x"] < 5.5, "on the way"


def test_what_fails_of_the_rover_ends_the_mission_of_both_in_order(tmp_path: Path) -> None:
    summary = run(tmp_path / "run", 1, "--fail", "rover_laser@3")
    assert summary["outcome"] == "given_up"
    done = skills(summary)
    assert ("rover_perception", "scan", "works") in done
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


def test_the_branch_by_which_the_other_robot_goes_there_is_written_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is deleted first; the drone is still for `arrival`, and the rover, which comes later, is so, too."""
    fleet = tmp_path / "fleet"
    shutil.copytree(FLEET, fleet, ignore=shutil.ignore_patterns("runs", ".alula"))
    (fleet / "robot.yaml").write_text(
        (FLEET / "robot.yaml").read_text().replace("../..", str(ALULA_ROOT)).replace("../rover", str(ALULA_ROOT / "examples/rover"))
    )
    mission = without_the_others_turn(ALULA_ROOT, fleet / "missions").mission
    assert run(tmp_path / "before", 1, "--fail", "drone_zed@4", fleet=fleet)["outcome"] == "given_up"
    monkeypatch.setenv("ALULA_ROBOT", str(fleet))
    subject = Subject.read(mission, pytest.fail)
    search = Search(subject, Question("drone_zed", most_faults=1, others=False), Deadline.after(600.0, print), print)
    repair = search.run().repair
    assert repair is not None
    assert (repair.branch.size, repair.left) == (1, ())
    assert "rover_base.drive_to comes later, for the same arrival." in " ".join(repair.text.split())
    mission.write_text(repair.text)
    checked = command("check", str(mission), "--json", "--time", "600", fleet=fleet)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    (file,) = json.loads(checked.stdout)["files"]
    assert [one["severity"] for one in file["findings"]] == ["note"], "what the file accepts"
    for words, outcome in (((), "accomplished"), (("--fail", "drone_zed@4"), "degraded"), (("--fail", "drone_zed@1"), "degraded")):
        summary = run(tmp_path / f"{outcome}{''.join(words)}", 0, *words, fleet=fleet)
        by_hand = run(tmp_path / f"hand{outcome}{''.join(words)}", 0, *words)
        assert (summary["outcome"], skills(summary)) == (outcome, skills(by_hand))


MISSION = """
<root BTCPP_format="4" main_tree_to_execute="hop">
  <BehaviorTree ID="hop">
    <Sequence>
      <one_navigation.takeoff name="up" height="2.0" speed="2.0"/>
      <one_navigation.land name="down"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="ready">
    <Needs name="it is ours" if="one_navigation.SDK_authority == AVAILABLE" otherwise="'it is not ours'"/>
  </BehaviorTree>
  <BehaviorTree ID="stop_here">
    <one_navigation.land name="land here"/>
  </BehaviorTree>
</root>
"""


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    """Return a fleet of the drone alone: it has what the drone's set-up has built, and needs none of its own."""
    folder = tmp_path / "fleet"
    for name, text in {
        "robot.yaml": f"name: fleet\nrobots: {{one: {ALULA_ROOT}}}\ndeparture: one_navigation.flight_status ON_GROUND\n",
        "scenarios/hop.yaml": "about: x\nmission: missions/hop.xml\nskillsets: [one_navigation]\n"
        "launch: skillset_ros1/fleet.launch\nrobots: {one: standby}\n",
        "missions/hop.xml": MISSION,
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    (folder / ".alula").symlink_to(Path(os.environ.get("ALULA_STATE", ALULA_ROOT / ".alula")) / "robot")
    return folder


def fly(fleet: Path, out: Path) -> subprocess.Popen[str]:
    words = [str(ALULA_ROOT / "setup/in_ros1"), "python3", "-m", "alula_flight.run", "hop", "--with", "one:--rate=0", "--out", str(out)]
    return subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env={**os.environ, "ALULA_ROBOT": str(fleet)}
    )


def left(out: Path) -> list[psutil.Process]:
    """Return what runs of the runs of the mission and of the robot."""
    ids = [json.loads(path.read_text(encoding="utf-8"))["run_id"] for path in (out / "run.json", out / "one" / "run.json")]
    return [process for run_id in ids for process in processes_of_run(run_id)]


@pytest.mark.flight
@pytest.mark.timeout(600)
def test_the_mission_of_a_fleet_flies_in_the_simulator_of_its_robot(hop: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    flight = fly(hop, out)
    said, _ = flight.communicate()
    assert flight.returncode == 0, said
    assert left(out) == []
    mission, robot = (json.loads((folder / "summary.json").read_text(encoding="utf-8")) for folder in (out, out / "one"))
    assert (mission["outcome"], robot["outcome"]) == ("accomplished", "served")
    assert skills(mission) == [("one_navigation", "takeoff", "AT_ALTITUDE"), ("one_navigation", "land", "LANDED")]
    assert skills(robot) == [("navigation", "takeoff", "AT_ALTITUDE"), ("navigation", "land", "LANDED")]
    assert (robot["landed"], robot["collisions"], robot["problems"], mission["problems"]) == (True, 0, [], [])
    # By one clock, the simulator's: the mission hears of each thing about when it happened by the robot's own record.
    begun_s = [
        [one.stamp_s for one in read_record(folder) if one.topic == EVENTS and one.value.get("state") == "RUNNING"]
        for folder in (out, out / "one")
    ]
    assert all(abs(heard_s - told_s) < 5.0 for heard_s, told_s in zip(*begun_s, strict=True)), begun_s
    assert "one: served" in said


@pytest.mark.flight
@pytest.mark.timeout(600)
def test_a_fleets_command_that_is_killed_leaves_nothing_behind_and_the_drone_landed(hop: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    flight = fly(hop, out)
    assert flight.stdout is not None
    assert any("takeoff: TERMINATED AT_ALTITUDE" in line for line in flight.stdout), "it never flew"
    started = psutil.Process(flight.pid).children(recursive=True)
    flight.kill()
    flight.wait()
    psutil.wait_procs(started)
    assert left(out) == []
    robot = json.loads((out / "one" / "summary.json").read_text(encoding="utf-8"))
    assert (robot["outcome"], robot["landed"], robot["collisions"]) == ("served", True, 0)
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))["outcome"] in {"aborted", "given_up"}
