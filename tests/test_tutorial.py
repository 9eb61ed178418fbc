"""The tutorial, done as it says, command by command, and a skill more by hand; Alula's folder can't be written to all the while.

Its live run is made while the drone flies, in the same DDS domain: each has a namespace.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from alula_testing.cover import read_only
from alula_testing.flights import Flight, start_flight
from alula_testing.on_what_runs import fly_on_what_runs

ALULA_ROOT = Path(__file__).resolve().parents[1]
SECTION = (ALULA_ROOT / "docs/start/own-robot.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^ {4}(alula .*)$", SECTION, re.MULTILINE)
BLOCKS = dict(re.findall(r"^```(\w+)\n(.*?)^```$", SECTION, re.MULTILINE | re.DOTALL))
MODEL, HOOKS, MISSION = "skillsets/rover.skill", "ros2_ws/src/rover_robot/rover_robot/hooks.py", "missions/patrol.xml"
TEST_OF_REST = """
    def test_it_rests(rig):
        handle = rig.client.start("rest", duration=0.3)
        rig.until(lambda: handle.done)
        assert (handle.outcome, handle.result) == ("TERMINATED", "RESTED")


    """


class Home:
    """A home folder with a link to Alula's entry; commands run in it, or in the robot once that is there."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.robot = folder, folder / "rover"
        (folder / "bin").mkdir()
        (folder / "bin" / "alula").symlink_to(ALULA_ROOT / "alula")
        self._before = read_only()
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("ALULA_ROBOT", "PYTHONPATH", "PYTEST_ADDOPTS", "ROS_DOMAIN_ID"))}
        self.environment = {**kept, "HOME": str(folder), "PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}

    def run(self, command: str) -> str:
        """Run a command of the page; return its standard output."""
        place = self.robot if self.robot.exists() else self.folder
        words = [*self._before, "sh", "-c", command]
        done = subprocess.run(words, cwd=place, capture_output=True, text=True, check=False, env=self.environment)
        assert done.returncode == 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-2000:]}"
        return done.stdout

    def insert(self, file: str, before: str, text: str) -> None:
        """Insert a text into a file of the robot."""
        path = self.robot / file
        content = path.read_text(encoding="utf-8")
        assert content.count(before) == 1, before
        path.write_text(content.replace(before, text + before), encoding="utf-8")


def passed(output: str) -> int:
    return sum(int(number) for number in re.findall(r"^(\d+) passed", output, re.MULTILINE))


@pytest.fixture
def drone(tmp_path: Path) -> Iterator[Flight]:
    """A flight of the checkout's robot, which is in the air; as fast as the live run beside it, for it needs to last no longer."""
    flight = start_flight(tmp_path / "flight", "--rate", "1", "--namespace", "drone")
    try:
        flight.wait_in_air()
        yield flight
    finally:
        flight.give_up()


def land(drone: Flight) -> None:
    """Have it land, and hold that nothing has disturbed it."""
    if drone.process.poll() is None:
        drone.process.send_signal(signal.SIGINT)
    drone.end()
    assert (drone.summary["landed"], drone.summary["collisions"], drone.summary["died"]) == (True, 0, [])
    assert {one["skillset"] for one in drone.summary["skills"]} == {"navigation", "perception", "mapping"}


@pytest.mark.timeout(0)  # builds a robot's interfaces: as long as the machine needs
def test_the_tutorial_works(tmp_path, request):
    home = Home(tmp_path)
    new, check, test, run, live, check_again, test_again, check_mission, run_again = COMMANDS
    assert "skillsets/mock.yaml" in home.run(new)
    home.run(check)
    untouched = passed(home.run(test))
    assert untouched >= 8
    assert "mission accomplished" in home.run(run)
    assert len(list(home.robot.glob("runs/*-patrol*/report.html"))) == 1
    drone = request.getfixturevalue("drone")
    live += f" --namespace rover --domain {drone.domain}"
    assert "mission accomplished in degraded mode: rover.drive: RESOURCE_INVARIANT_VIOLATED way_stays_clear" in home.run(live)
    land(drone)
    flown = max(home.robot.glob("runs/*-patrol*"), key=lambda run: (run / "report.html").stat().st_mtime)
    summary = json.loads((flown / "summary.json").read_text(encoding="utf-8"))
    assert (summary["mock"], summary["problems"], summary["died"]) == (None, [], [])
    assert [(one["skill"], one["result"]) for one in summary["skills"]] == [("drive", "way_stays_clear"), ("back_off", "CLEAR_OF_IT")]
    assert summary["bridge"]["/rover/odom"]["count"] > 0
    assert summary["bridge"]["/rover/alive"]["count"] > 0, "what stops the base hears the managers"
    assert "/rover/alive is heard" in (flown / "logs/nodes/rosout.log").read_text(encoding="utf-8")
    assert (flown / "functional.bag").is_file()
    assert json.loads((flown / "run.json").read_text(encoding="utf-8"))["namespace"] == "/rover"
    assert "not in /rover" not in "".join(log.read_text(encoding="utf-8") for log in (flown / "logs").rglob("*.log"))
    home.run(f"{ALULA_ROOT}/setup/in_ros2 ruff check {home.robot}")

    home.insert(MODEL, "  // `alula check` proves this.\n", BLOCKS["skill"] + "\n")
    home.insert(HOOKS, "def make_hooks(", BLOCKS["python"] + "\n\n")
    home.insert(HOOKS, "AbstractDriveSkill\n", "AbstractRestSkill, ")
    home.insert(HOOKS, "DriveInputs\n", "RestInputs, ")
    home.insert(HOOKS, '"back_off": BackOff(base)}', '"rest": Rest(base), ')
    live = "ros2_ws/src/rover_robot/test/test_rover_live.py"
    home.insert(live, "def test_what_can_not_be_is_refused", textwrap.dedent(TEST_OF_REST).lstrip())
    home.run(check_again)
    assert passed(home.run(test_again)) == untouched + 1

    home.insert(MISSION, "        <rover.back_off", BLOCKS["xml"])
    assert home.run(check_mission) == "missions/patrol.xml: ok\n"
    assert "mission accomplished in degraded mode" in home.run(run_again)
    flown = max(home.robot.glob("runs/*-patrol*"), key=lambda run: (run / "report.html").stat().st_mtime)
    summary = json.loads((flown / "summary.json").read_text(encoding="utf-8"))
    assert [(one["skill"], one["result"]) for one in summary["skills"][1:]] == [("rest", "RESTED"), ("back_off", "CLEAR_OF_IT")]

    fly_on_what_runs(home.robot, home.run, home.environment)
