"""docs/changing-a-mission.md as it stands: the changes are made, checked and flown over mocks."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from alula.cli import check, run

ALULA_ROOT = Path(__file__).resolve().parents[4]
PAGE = (ALULA_ROOT / "docs/changing-a-mission.md").read_text(encoding="utf-8")
CHANGES = re.findall(r"^```diff\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


class Robot:
    """The drone with missions of its own."""

    def __init__(self, folder: Path) -> None:
        shutil.copytree(ALULA_ROOT / "missions", folder / "missions")
        (folder / "scenarios").mkdir()
        self.file = folder / "missions/inspection.xml"
        scenario = (ALULA_ROOT / "scenarios/inspection.yaml").read_text(encoding="utf-8")
        (folder / "scenarios/inspection.yaml").write_text(scenario.replace("missions/inspection.xml", str(self.file)), encoding="utf-8")
        self.folder, self.runs = folder, 0

    def change(self, *changes: str) -> None:
        """Do what the page says."""
        text = self.file.read_text(encoding="utf-8")
        for change in changes:
            old, new = ("".join(f"{line[1:]}\n" for line in change.splitlines() if line[0] == sign) for sign in "-+")
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        self.file.write_text(text, encoding="utf-8")
        assert check.main([str(self.file), "--time", "4"]) == 0

    def fly(self, *faults: str) -> tuple[dict, dict]:
        """Fly it over mocks; return summary and mission."""
        self.runs += 1
        out = self.folder / f"run{self.runs}"
        words = [word for fault in faults for word in ("--fail", fault)]
        assert run.main(["inspection", "--mock", "--out", str(out), *words]) == 0
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        return summary, summary["mission"]


@pytest.fixture
def robot(tmp_path, monkeypatch):
    monkeypatch.setattr("alula.common.scenarios.scenarios_folder", lambda: tmp_path / "scenarios")
    return Robot(tmp_path)


def targets(summary):
    return [one["inputs"]["target"]["z"] for one in summary["skills"] if one["skill"] == "goto"]


def test_a_third_height(robot, capsys):
    robot.change(CHANGES[0])
    # What the file accepts is a note, and so is that not all runs were looked at in the time.
    assert re.search(r"inspection\.xml: ok, [12] notes?\n$", capsys.readouterr().out)
    summary, mission = robot.fly()
    assert (summary["outcome"], mission["waypoints"], mission["waypoints_reached"]) == ("accomplished", 15, 15)
    assert targets(summary) == [3.0] * 5 + [7.0] * 5 + [10.0] * 5


@pytest.mark.parametrize(("slip", "code", "cure"), [('heights="3;7;ten"', "ALU605", "3;7;ten"), ('hights="3;7"', "ALU603", "heights")])
def test_a_slip_is_told_with_its_place(robot, capsys, slip, code, cure):
    text = robot.file.read_text(encoding="utf-8").replace('route="{route}" reached', f'route="{{route}}" {slip} reached')
    robot.file.write_text(text, encoding="utf-8")
    assert check.main([str(robot.file)]) == 1
    said = capsys.readouterr().out
    assert code in said
    assert cure in said


def test_another_reaction_to_bad_video(robot):
    robot.change(*CHANGES)
    summary, mission = robot.fly("radio:out@30-40")
    assert (summary["outcome"], mission["waypoints_reached"]) == ("degraded", 15)
    assert sum(one["skill"] == "stream" for one in summary["skills"]) == 2
    summary, mission = robot.fly("radio:out@30")
    assert summary["outcome"] == "degraded"
    assert mission["waypoints_reached"] < 15
    assert [one["skill"] for one in summary["skills"]][-2:] == ["hover", "land"]
