"""The page about robots from trees, done as it says: command by command, from a folder of trees to a sharper finding."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
PAGE = (ALULA_ROOT / "docs/how-to/from-trees.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
COMMANDS, COMMANDS_AFTER = (re.findall(r"^ {4}alula (.*)$", part, re.MULTILINE) for part in PAGE.split("## Write down"))


class Desk:
    """A folder in which the page's commands are run; in the robot's once that is there."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.robot = folder, folder / "porter"

    def run(self, words: str) -> subprocess.CompletedProcess[str]:
        """Run a command of the page."""
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ALULA_ROBOT")}
        place = self.robot if self.robot.exists() else self.folder
        command = [str(ALULA_ROOT / "alula"), *words.split()]
        return subprocess.run(command, cwd=place, capture_output=True, text=True, check=False, env=environment)


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Desk:
    desk = Desk(tmp_path_factory.mktemp("desk"))
    (desk.folder / "trees").mkdir()
    (desk.folder / "trees/deliver.xml").write_text(BLOCKS["xml"], encoding="utf-8")
    return desk


def summaries(desk: Desk) -> list[dict]:
    return [
        json.loads(path.read_text())
        for path in sorted((desk.robot / "runs").glob("*/summary.json"), key=lambda path: path.stat().st_mtime_ns)
    ]


def test_the_page_from_a_folder_to_reports_counterexamples_and_odds(desk: Desk) -> None:
    outputs = {}
    for words in COMMANDS:
        done = desk.run(words)
        assert done.returncode == 0, f"{words}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
        outputs[words] = done.stdout
    nominal, failing = summaries(desk)
    assert [one["skill"] for one in nominal["skills"]] == ["open_door", "move_to", "grasp", "move_to", "release"]
    assert [one["skill"] for one in failing["skills"]][-2:] == ["handover", "release"]
    assert (nominal["outcome"], failing["outcome"]) == ("accomplished", "accomplished")
    assert "the mission comes to the same end: given_up" in outputs["check missions/deliver.xml --play 1"]
    assert len(list((desk.robot / "runs").glob("*/report.html"))) == 3
    assert "holds_it" not in outputs["check missions/deliver.xml"]
    assert "accomplished" in outputs["odds missions/deliver.xml"]


def test_what_is_written_down_makes_a_finding(desk: Desk) -> None:
    model = desk.robot / "skillsets/porter.skill"
    text = model.read_text()
    for name in re.findall(r"^  skill (\w+)", BLOCKS["skill"], re.MULTILINE):
        text, count = re.subn(rf"^  skill {name} {{\n.*?^  }}\n", "", text, flags=re.MULTILINE | re.DOTALL)
        assert count == 1, name
    model.write_text(text.rstrip().removesuffix("}") + "\n" + BLOCKS["skill"] + "}\n")
    checked, ran = map(desk.run, COMMANDS_AFTER)
    assert checked.returncode == 0, checked.stdout
    assert "`porter.release` is refused: NOT_READY (holds_it)" in checked.stdout
    assert ran.returncode == 1, ran.stderr
    last = summaries(desk)[-1]
    assert last["outcome"] == "given_up"
    assert [(one["skill"], one["outcome"]) for one in last["skills"]][-2:] == [("handover", "TERMINATED"), ("release", "NOT_READY")]
