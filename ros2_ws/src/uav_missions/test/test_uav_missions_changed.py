"""docs/how-to/changing-a-mission.md as it stands: the changes are made, checked and flown over mocks."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from alula import Diagnostic, Mission, Severity, check_files, open_run

ALULA_ROOT = Path(__file__).resolve().parents[4]
PAGE = (ALULA_ROOT / "docs/how-to/changing-a-mission.md").read_text(encoding="utf-8")
CHANGES = re.findall(r"^```diff\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


class Robot:
    """The drone with missions of its own."""

    def __init__(self, folder: Path) -> None:
        for name in ("robot.yaml", "skillsets", "scenarios", "ros1_ws", "ros2_ws", "setup"):
            (folder / name).symlink_to(ALULA_ROOT / name)
        shutil.copytree(ALULA_ROOT / "missions", folder / "missions")
        self.file = folder / "missions/inspection.xml"
        self.folder, self.runs = folder, 0

    def change(self, *changes: str) -> None:
        """Do what the page says, and check it."""
        text = self.file.read_text(encoding="utf-8")
        for change in changes:
            old, new = ("".join(f"{line[1:]}\n" for line in change.splitlines() if line[0] == sign) for sign in "-+")
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        self.file.write_text(text, encoding="utf-8")
        found = self.findings(timeout_s=4.0)
        # What the file accepts is a note, and so is that not all runs were looked at in the time.
        assert {one.severity for one in found} == {Severity.NOTE}
        assert len(found) in {1, 2}

    def findings(self, timeout_s: float = 30.0) -> list[Diagnostic]:
        """Check it."""
        return check_files(self.file, robot=self.folder, timeout_s=timeout_s)

    def fly(self, *faults: str) -> tuple[dict, dict]:
        """Fly it over mocks; return summary and mission."""
        self.runs += 1
        out = self.folder / f"run{self.runs}"
        Mission.load("inspection", self.folder).run(*faults, out=out)
        summary = open_run(out, self.folder).report()
        return summary, summary["mission"]


@pytest.fixture
def robot(tmp_path):
    return Robot(tmp_path)


def targets(summary):
    return [one["inputs"]["target"]["z"] for one in summary["skills"] if one["skill"] == "goto"]


def test_a_third_height(robot):
    robot.change(CHANGES[0])
    summary, mission = robot.fly()
    assert (summary["outcome"], mission["waypoints"], mission["waypoints_reached"]) == ("accomplished", 15, 15)
    assert targets(summary) == [3.0] * 5 + [7.0] * 5 + [10.0] * 5


@pytest.mark.parametrize(("slip", "code", "cure"), [('heights="3;7;ten"', "ALU605", "3;7;ten"), ('hights="3;7"', "ALU603", "heights")])
def test_a_slip_is_told_with_its_place(robot, slip, code, cure):
    text = robot.file.read_text(encoding="utf-8").replace('route="{route}" reached', f'route="{{route}}" {slip} reached')
    robot.file.write_text(text, encoding="utf-8")
    (error,) = [one for one in robot.findings() if one.severity is Severity.ERROR]
    assert error.code == code
    assert error.span.line > 1
    assert cure in error.render()


def test_another_reaction_to_bad_video(robot):
    robot.change(*CHANGES)
    summary, mission = robot.fly("radio:out@30-40")
    assert (summary["outcome"], mission["waypoints_reached"]) == ("degraded", 15)
    assert sum(one["skill"] == "stream" for one in summary["skills"]) == 2
    summary, mission = robot.fly("radio:out@30")
    assert summary["outcome"] == "degraded"
    assert mission["waypoints_reached"] < 15
    assert [one["skill"] for one in summary["skills"]][-2:] == ["hover", "land"]
