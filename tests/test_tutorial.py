"""The tutorial, done as it says, command by command, and a skill more by hand."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from alula_testing.cover import cover

ALULA_ROOT = Path(__file__).resolve().parents[1]
SECTION = (ALULA_ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^ {4}(\./alula .*)$", SECTION, re.MULTILINE)
BLOCKS = dict(re.findall(r"^```(\w+)\n(.*?)^```$", SECTION, re.MULTILINE | re.DOTALL))
MODEL, HOOKS = "skillsets/rover/rover.skill", "ros2_ws/src/rover_robot/rover_robot/hooks.py"


@pytest.fixture
def checkout(tmp_path):
    """Return the words before a command that has it work on the checkout and leave the checkout as it is."""
    return cover(tmp_path)


def run(checkout, *command) -> str:
    environment = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "PYTEST_ADDOPTS", "ROS_DOMAIN_ID"}}
    done = subprocess.run([*checkout, *command], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout[-4000:]}\n{done.stderr[-2000:]}"
    return done.stdout


EDIT = """
from pathlib import Path
import sys
place, before, text = sys.argv[1:]
path = Path(place)
content = path.read_text(encoding="utf-8")
assert content.count(before) == 1, before
path.write_text(content.replace(before, text + before), encoding="utf-8")
"""


def insert(checkout, place: str, before: str, text: str) -> None:
    run(checkout, sys.executable, "-c", EDIT, place, before, text)


def passed(output: str) -> int:
    return sum(int(number) for number in re.findall(r"^(\d+) passed", output, re.MULTILINE))


@pytest.mark.timeout(0)  # builds a robot's interfaces: as long as the machine needs
def test_the_tutorial_works(checkout):
    new, check, test, check_again, test_again = (command.split() for command in COMMANDS)
    assert "skillsets/rover/mock.yaml" in run(checkout, *new)
    run(checkout, *check)
    untouched = passed(run(checkout, *test))
    assert untouched >= 8
    run(checkout, "./setup/in_ros2", "ruff", "check", "ros2_ws/src/rover_robot")

    insert(checkout, MODEL, "  // `./alula check` proves this.\n", BLOCKS["skill"] + "\n")
    insert(checkout, HOOKS, "def make_hooks(", BLOCKS["python"] + "\n\n")
    insert(checkout, HOOKS, "AbstractDriveSkill\n", "AbstractRestSkill, ")
    insert(checkout, HOOKS, "DriveInputs\n", "RestInputs, ")
    insert(checkout, HOOKS, '"back_off": BackOff(base)}', '"rest": Rest(base), ')
    test_of_rest = """
        def test_it_rests(rig):
            handle = rig.client.start("rest", duration=0.3)
            rig.until(lambda: handle.done)
            assert (handle.outcome, handle.result) == ("TERMINATED", "RESTED")


        """
    live = "ros2_ws/src/rover_robot/test/test_rover_live.py"
    insert(checkout, live, "def test_what_can_not_be_is_refused", textwrap.dedent(test_of_rest).lstrip())
    run(checkout, *check_again)
    assert passed(run(checkout, *test_again)) == untouched + 1
    assert not (ALULA_ROOT / "skillsets/rover").exists()
