"""The rover of examples/, copied out of the checkout: it shares nothing with the drone; Alula can't be written to meanwhile."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from alula.common.network import claim_domain, free_port
from alula_testing.cover import read_only
from alula_testing.ros1 import end_process

ALULA_ROOT = Path(__file__).resolve().parents[1]
IN_ROS2 = str(ALULA_ROOT / "setup/in_ros2")
CLIENTS = str(ALULA_ROOT / "tests/support/alula_testing/rover_clients.py")


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
    done = run(rover, "alula.cli.check", *models, *missions)
    assert done.returncode == 0, done.stdout + done.stderr
    # What a mission accepts is a note, and one that the time was over before all its runs were looked at.
    assert len(re.findall(r": ok(, 1 note|, 2 notes)?$", done.stdout, re.MULTILINE)) == len(models) + len(missions)
    assert set(re.findall(r"note (ALU\d+)", done.stdout)) <= {"ALU701", "ALU710"}


def test_the_laser_dies_and_it_reports_where_it_waits(rover: Path, tmp_path: Path) -> None:
    done = run(rover, "alula.cli.run", "deliver", "--mock", "--fail", "laser@30", "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert (summary["outcome"], summary["problems"]) == ("degraded", [])
    assert [one["result"] for one in summary["skills"] if one["skill"] == "creep"] == ["ARRIVED"]
    assert (tmp_path / "run/report.html").is_file()


def test_a_run_is_decided_again_and_held_against_what_is_expected_of_it(rover: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert run(rover, "alula.cli.run", "deliver", "--mock", "--fail", "pose@20-25", "--out", str(folder)).returncode == 0
    again = run(rover, "alula.cli.replay", str(folder))
    assert again.returncode == 0, again.stdout + again.stderr
    assert "decisions, all as they were" in again.stderr
    assert "decisions differ at" in run(rover, "alula.cli.replay", str(folder), "--fail", "laser@40").stderr
    (tmp_path / "expected.yaml").write_text(run(rover, "alula.cli.expect", str(folder)).stdout, encoding="utf-8")
    held = run(rover, "alula.cli.expect", str(folder), "--check", str(tmp_path / "expected.yaml"))
    assert held.returncode == 0, held.stdout + held.stderr
    assert run(rover, "alula.cli.run", "deliver", "--mock", "--out", str(tmp_path / "other")).returncode == 0
    assert run(rover, "alula.cli.expect", str(tmp_path / "other"), "--check", str(tmp_path / "expected.yaml")).returncode == 1


def test_a_campaign_finds_no_trouble_in_runs_that_end_where_it_may_be_left(rover: Path, tmp_path: Path) -> None:
    faults = "[[pose@20], [laser@30], [bumper@10, laser@20], [battery@30]]"
    (tmp_path / "campaign.yaml").write_text(f"scenarios: [deliver]\nseeds: [0]\nfaults: {faults}\n", encoding="utf-8")
    # All runs of the mission are not looked at here: test_its_models_are_proved_and_its_missions_have_no_findings does.
    done = run(rover, "alula.cli.campaign", str(tmp_path / "campaign.yaml"), "--out", str(tmp_path / "out"), "--time", "0")
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [json.loads(line) for line in (tmp_path / "out/runs.jsonl").read_text(encoding="utf-8").splitlines()]
    ends = [(row["outcome"], row["landed"]) for row in sorted(rows, key=lambda row: row["run"])]
    assert ends == [("given_up", None), ("degraded", None), ("given_up", None), ("degraded", True)]


def test_no_line_of_the_framework_names_it() -> None:
    places = ["lib/alula", "bridge", "flight", "setup", "ros1_ws/src/skillset_ros1", "ros2_ws/src/skillset_ros2"]
    pattern = r"examples/rover|rover_(robot|navigation|simulator|bringup)|move_base"
    command = ["grep", "-rlE", "--include=*.py", "--include=*.yaml", "--include=*.launch", "--include=*.sh", pattern, *places]
    found = subprocess.run(command, cwd=ALULA_ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    assert [line for line in found if "/test/" not in line] == []


# --- live ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ready(rover: Path) -> Path:
    """Return the copy, set up, with a world in which there is one parcel to be delivered."""
    office = (rover / "worlds/office.yaml").read_text(encoding="utf-8")
    before, _, after = office.partition("parcels:\n")
    first, rest = after.partition("\n")[0], after.partition("rounds:")[2]
    (rover / "worlds/one.yaml").write_text(f"{before}parcels:\n{first}\nrounds:{rest}", encoding="utf-8")
    done = alula(rover, "setup")
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    return rover


def alula(rover: Path, *words: str) -> subprocess.CompletedProcess[str]:
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("ALULA_ROBOT", "PYTHONPATH", "PYTEST_ADDOPTS", "ROS_DOMAIN_ID"))}
    command = [*read_only(), str(ALULA_ROOT / "alula"), "--robot", str(rover), *words]
    return subprocess.run(command, cwd=rover, capture_output=True, text=True, check=False, env=kept)


@pytest.mark.flight
@pytest.mark.timeout(0)  # builds a robot's packages: as long as the machine needs
def test_carried_into_a_room_that_is_shut_and_its_navigation_killed_it_delivers_its_parcel(ready: Path, tmp_path: Path) -> None:
    faults = ["--fail", "pose:lost@14", "--fail", "navigation:killed@20-21"]
    done = alula(ready, "run", "deliver", "--world", "one", "--rate", "0", *faults, "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert "parcels: 1 of 1 done" in done.stdout
    summary = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert (summary["outcome"], summary["landed"], summary["problems"]) == ("degraded", True, [])
    assert (summary["collisions"], summary["tasks"]) == (0, [{"name": "store-kitchen", "done": True, "why": ""}])
    assert [(one["name"], one["how"]) for one in summary["died"]] == [("navigation", "signal SIGKILL")]
    ended = [(one["skill"], one["result"]) for one in summary["skills"]]
    answer = ended[ended.index(("drive_to", "keeps_pose")) :]
    order = [one for one in answer if one[0] in {"stop_here", "localise", "open_door", "load", "unload", "dock"}]
    assert order[:7] == [("stop_here", "STANDING"), ("localise", "FOUND"), *[("open_door", "OPEN")] * 5]
    assert [one for one in order[7:] if one[0] != "open_door"] == [("load", "LOADED"), ("unload", "UNLOADED"), ("dock", "DOCKED")]
    assert (tmp_path / "run/report.html").is_file()
    again = alula(ready, "replay", str(tmp_path / "run"), "--from", "skills")
    assert again.returncode == 0, again.stdout[-2000:] + again.stderr
    assert "decisions, all as they were" in again.stderr


@pytest.mark.timeout(0)
def test_its_hooks_work_over_faked_functions(ready: Path) -> None:
    done = alula(ready, "test", "ros2_ws/src/rover_robot/test")
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
    assert re.search(r"^\d+ passed", done.stdout, re.MULTILINE)


LAYER = """<launch>
  <include file="$(find rover_navigation)/launch/functional.launch">
    <arg name="world" value="$(env ALULA_ROBOT)/worlds/office.yaml"/>
    <arg name="rate" value="1"/>
  </include>
  <node pkg="skillset_ros1" type="in_ros2" name="managers"
        args="python -m skillset_ros2.managers base=rover_robot.hooks.base:make_hooks --ros-args -p use_sim_time:=true"/>
  <node pkg="skillset_ros1" type="in_ros2" name="ros_bridge"
        args="python -m ros_bridge --config $(env ALULA_ROBOT_STATE)/generated/rover_bridge.yaml"/>
</launch>
"""
"""The functional layer, the bridge, and the managers of one skillset: no mission.

Simulated time waits for no managers here, as a vehicle's does not: at a rate of 4 a machine that was busy for a second had the managers
lose the navigation, which may be silent for 4 s of mission clock.
"""


@pytest.mark.flight
@pytest.mark.timeout(0)
def test_stock_clients_drive_it_by_its_navigation_and_by_its_skills(ready: Path, tmp_path: Path) -> None:
    (tmp_path / "layer.launch").write_text(LAYER, encoding="utf-8")
    port, domain = free_port(), claim_domain()
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHONPATH", "PYTEST_ADDOPTS"))}
    graph = {"ALULA_ROBOT": str(ready), "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    environment = {**kept, **graph, "ROS_DOMAIN_ID": str(domain.domain), "ROS_LOG_DIR": str(tmp_path)}

    def client(world: int) -> dict[str, object]:
        command = [str(ALULA_ROOT / f"setup/in_ros{world}"), "python", CLIENTS, f"ros{world}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        assert done.returncode == 0, done.stderr[-3000:]
        return dict(json.loads(done.stdout.splitlines()[-1]))

    launch = [str(ALULA_ROOT / "setup/in_ros1"), "roslaunch", "-p", str(port), str(tmp_path / "layer.launch")]
    with (tmp_path / "launch.log").open("w") as log:
        layer = subprocess.Popen(launch, env=environment, stdout=log, stderr=log, start_new_session=True)
        try:
            by_skills, by_navigation = client(2), client(1)
        finally:
            end_process(layer, timeout_s=60.0)
            domain.release()
    assert (by_skills["driven"], by_skills["stopped"]) == (["TERMINATED", "ARRIVED", ""], "INTERRUPTED")
    assert (by_navigation["state"], by_navigation["text"]) == (3, "arrived")  # actionlib's SUCCEEDED
    assert by_skills["heard"]
    assert by_navigation["heard"]


STEP = re.compile(r"[Ii]n\s`([\w./]+)`, (before|in place of) `([^`]+)`:\n\n```\w+\n(.*?)```", re.DOTALL)
"""In which file, how, where: the lines."""


def test_the_page_that_adds_a_skill_works_as_it_stands(rover: Path, tmp_path: Path) -> None:
    copy = tmp_path / "rover"
    shutil.copytree(rover, copy, ignore=shutil.ignore_patterns(".alula", "runs"))
    steps = STEP.findall((copy / "ADD_A_SKILL.md").read_text(encoding="utf-8"))
    assert [Path(file).name for file, *_ in steps] == [
        *("cargo.skill", "mock.yaml", "answers.xml", "bindings.yaml", "cargo.py", "node.py", "faults.yaml"),
    ]
    for file, how, marker, lines in steps:
        path = copy / file
        before, found, after = path.read_text(encoding="utf-8").partition(marker)
        assert found, f"{file} has no {marker}"
        path.write_text(before + lines + (after.lstrip("\n") if how == "in place of" else found + after), encoding="utf-8")
        if path.suffix == ".py":
            compile(path.read_text(encoding="utf-8"), path, "exec")
    done = run(copy, "alula.cli.check", str(copy / "skillsets/cargo.skill"))
    assert done.returncode == 0, done.stdout + done.stderr
    (tmp_path / "mute.yaml").write_text("skills: {cargo.honk: {result: MUTE}}", encoding="utf-8")
    for words, ends in (([], ["HONKED", "ARRIVED"]), (["--behaviour", str(tmp_path / "mute.yaml")], ["MUTE", "ANSWERED", "ARRIVED"])):
        out = tmp_path / f"run{len(words)}"
        done = run(copy, "alula.cli.run", "deliver", "--mock", "--fail", "laser@30", *words, "--out", str(out))
        assert done.returncode == 0, done.stdout + done.stderr
        skills = [(one["skill"], one["result"]) for one in json.loads((out / "summary.json").read_text(encoding="utf-8"))["skills"]]
        at = next(at for at, (skill, _) in enumerate(skills) if skill == "honk")
        assert [result for _, result in skills[at : at + len(ends)]] == ends
