"""Missions on what runs already: a new robot's base by plain roslaunch, its deployment up, two missions in turn."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import psutil
import pytest

from alula.common.network import claim_domain, free_port
from alula.common.processes import end_run, node_name, processes_of_run
from alula.common.record import EVENTS, FILE, RecordFollower, read_record
from alula_testing.waits import until

ALULA_ROOT = Path(__file__).resolve().parents[3]
PARTS = ("bridge", "managers", "recorder", "page")
END_S = 60.0
Run = Callable[[str], str]


def fly_on_what_runs(robot: Path, run: Run, environment: dict[str, str]) -> None:
    """Have the deployment of a new robot, rover, do what it is for; ``run`` runs a command in its folder and returns its output."""
    port, claim = free_port(), claim_domain()
    claim.release()
    file = robot / "deployments/robot.yaml"
    text = file.read_text(encoding="utf-8")
    ours_for = {"127.0.0.1:11311": f"127.0.0.1:{port}", "domain: 42": f"domain: {claim.domain}", "port: 8440": f"port: {free_port()}"}
    for usual, ours in ours_for.items():
        assert usual in text
        text = text.replace(usual, ours)
    file.write_text(text, encoding="utf-8")
    graph = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(robot / ".ros"),
        "ALULA_ROBOT": str(robot),
    }
    launch = [str(ALULA_ROOT / "setup/in_ros1"), "roslaunch", "-p", str(port), "rover_base", "base.launch"]
    state = robot / ".alula/up/robot/state.json"
    with (robot / "base.log").open("wb") as log:
        base = subprocess.Popen(launch, cwd=robot, env={**environment, **graph}, stdout=log, stderr=log, start_new_session=True)
        try:
            until(lambda: status(run)["master_problem"] == "", "the base's master answers", every_s=0.5)
            _two_missions(robot, run)
            _deaths(robot, run)
            _a_mission_dies(robot, run)
            ended, known = processes(run), json.loads(state.read_text(encoding="utf-8"))
            run("alula down robot")
            assert not processes_of_run(known["run_id"])
            assert not [pid for pid in [*ended.values(), known["keeper"]] if lives(pid)]
            assert base.poll() is None
            assert status(run)["master_problem"] == ""
        finally:
            if state.exists():  # keeper and page first, which do not carry the run's id
                left = json.loads(state.read_text(encoding="utf-8"))["run_id"]
                run("alula down robot || true")
                end_run(left)
            os.killpg(base.pid, signal.SIGINT)
            base.wait(END_S)


def _two_missions(robot: Path, run: Run) -> None:
    run("alula up robot")
    begun = processes(run)
    assert tuple(begun) == PARTS
    until(lambda: knows_the_base(run), "the base reports its resources, and receives the managers' heartbeat")
    stamps = []
    for name in ("first", "second"):
        assert "mission accomplished\n" in run(f"alula run patrol --on robot --out runs/{name}")
        summary = json.loads((robot / "runs" / name / "summary.json").read_text(encoding="utf-8"))
        assert (summary["problems"], summary["died"]) == ([], [])
        assert [(one["skill"], one["result"]) for one in summary["skills"]] == [("drive", "ARRIVED")]
        assert [one["to"] for one in summary["resources"]] == ["USED", "FREE"]
        assert (robot / "runs" / name / "functional.bag").is_file()
        events = [entry.value for entry in read_record(robot / "runs" / name / FILE) if entry.topic == EVENTS]
        stamps.append([one["stamp_s"] for one in events])
    assert max(stamps[0]) < min(stamps[1])
    run("alula up robot")
    assert processes(run) == begun
    hooks = "ros2_ws/src/rover_robot/rover_robot/hooks.py"
    (robot / hooks).write_text(f"{(robot / hooks).read_text(encoding='utf-8')}\n# Tuned on the robot.\n", encoding="utf-8")
    assert f"managers is started again, changed: {hooks}\n" in run("alula up robot 2>&1")
    assert [name for name, pid in processes(run).items() if pid != begun[name]] == ["managers"]
    until(lambda: knows_the_base(run), "the new managers know the resources")


def _deaths(robot: Path, run: Run) -> None:
    """A part that is killed runs again; another keeper takes over what runs; what a mission that is killed has started is stopped."""
    for victim in ("bridge", "managers"):
        begun = processes(run)
        os.kill(begun[victim], signal.SIGKILL)
        again = lambda part: part["state"] == "running" and part["pid"] != begun[victim]  # noqa: B023, E731 - called in here
        until(lambda: again(status(run)["parts"][victim]), f"the {victim} run again", every_s=0.5)  # noqa: B023
        before = processes(run)
        assert [name for name in PARTS if before[name] != begun[name]] == [victim]
    os.kill(json.loads((robot / ".alula/up/robot/state.json").read_text(encoding="utf-8"))["keeper"], signal.SIGKILL)
    run("alula up robot --restart recorder")
    after = processes(run)
    assert [name for name in PARTS if after[name] != before[name]] == ["recorder"]
    until(lambda: knows_the_base(run), "the managers that were started again know the resources")


def _a_mission_dies(robot: Path, run: Run) -> None:
    """Its managers live on, so what it has started is interrupted."""
    folder = robot / "runs/killed"
    with ThreadPoolExecutor(1) as pool:
        flown = pool.submit(run, "alula run patrol --on robot --out runs/killed 2>&1 || true")
        record = folder / FILE

        def ended() -> bool:
            return flown.done() and pytest.fail(f"it has ended without a drive: {flown.result()}")

        until(lambda: record.exists() or ended(), "the mission writes its record", every_s=0.1)
        follower = RecordFollower(record)

        def drives() -> bool:
            return any(one.topic == EVENTS and one.value.get("state") == "RUNNING" for one in follower.poll()) or ended()

        until(drives, "it drives", every_s=0.1)
        run_id = json.loads((folder / "run.json").read_text(encoding="utf-8"))["run_id"]
        (mission,) = [one for one in processes_of_run(run_id) if node_name(one) == "mission"]
        mission.kill()
        told = flown.result()
    assert "what runs is interrupted" in told
    assert "not all of it stopped" not in told
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert [(one["name"], one["how"]) for one in summary["died"]] == [("mission", "signal SIGKILL")]
    assert (summary["outcome"], summary["reason"]) == ("aborted", "ended by the supervisor: mission died (signal SIGKILL)")


def lives(pid: int) -> bool:
    """Return whether a process runs; one that nobody has asked for its end does not."""
    try:
        return bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def knows_the_base(run: Run) -> bool:
    """Return whether the managers know what the base reports, and the base receives their heartbeat."""
    return bool(json.loads(run("alula skills --json"))["resources"] == {"wheels": "FREE", "bumper": "CLEAR", "link": "UP"})


def status(run: Run) -> dict[str, Any]:
    """Return what ``alula status`` tells."""
    return dict(json.loads(run("alula status robot --json || true")))


def processes(run: Run) -> dict[str, int]:
    """Return the process of each part."""
    return {name: part["pid"] for name, part in status(run)["parts"].items()}
