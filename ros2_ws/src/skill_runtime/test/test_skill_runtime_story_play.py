"""The stories of the proofs, played in the managers: each comes to the end that it tells."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from skill_language.models import check_files
from skill_language.prove import prove
from skill_language.stories import StateChange, Story
from skill_runtime import check_play
from skill_runtime.story_play import play

PAGE = next(p / "skillsets" / "PROOFS.md" for p in Path(__file__).resolve().parents if (p / "skillsets" / "PROOFS.md").exists())
SECTION = re.compile(r"^### (ALU\d+): .*?```rl\n(.*?)```", re.MULTILINE | re.DOTALL)
EXAMPLES = dict(SECTION.findall(PAGE.read_text()))
DATA = """
skillset watch {
  data fps: float64 period 1 sec
  data battery: Battery
  type Battery
  resource eyes { state { Shut Open } initial Shut transition { Shut -> Open  Open -> Shut } }
  skill look {
    precondition { sees: fps >= 10  shut: eyes == Shut }
    start eyes -> Open
    invariant {
      sees { guard fps >= 10 recovers at 12 effect eyes -> Shut }
      power { guard battery.level > 20 % for 3 s }
    }
    progress { period 1 sec deadline 2 sec }
    interrupt { effect eyes -> Shut }
    success DONE { effect eyes -> Shut }
  }
  property shut: never eyes == Open
}
"""
OUTSIDE = """
skillset uav {
  resource authority { state { Pilot Drone } initial Pilot transition { Pilot -> Drone  Drone -> Pilot } }
  type Point
  skill goto {
    input { target: Point  speed: float64  fast: bool }
    output { reached: float64 }
    precondition { a: authority == Drone }
    success arrived
  }
  property ends: goto running leads to authority == Pilot
  property no: never goto running
}
"""


def stories(path, text):
    path.write_text(text)
    (file,) = check_files([path])
    (skillset,) = file.skillsets
    return skillset, [finding for finding in prove(skillset) if finding.story.steps]


def differences(skillset, story):
    return [(number, one.differences) for number, one in enumerate(play(skillset, story), 1) if one.differences]


@pytest.mark.parametrize("code", sorted(EXAMPLES))
def test_every_story_of_the_page_plays(code, tmp_path):
    skillset, findings = stories(tmp_path / "example.rl", EXAMPLES[code])
    for finding in findings:
        assert differences(skillset, finding.story) == [], finding.counterexample


@pytest.mark.parametrize("text", [DATA, OUTSIDE], ids=["data and time", "from outside"])
def test_stories_with_data_time_and_arrows_from_outside_play(text, tmp_path):
    skillset, findings = stories(tmp_path / "example.rl", text)
    assert findings
    for finding in findings:
        assert differences(skillset, finding.story) == [], finding.counterexample
    told = {step.kind.value for finding in findings for step in finding.story.steps}
    assert {"data", "time", "start"} <= told if text is DATA else "outside" in told


def test_a_story_that_is_not_so_is_told(tmp_path):
    skillset, findings = stories(tmp_path / "example.rl", EXAMPLES["ALU513"])
    (finding,) = findings
    last = finding.story.steps[-1]
    wrong = replace(last, states=(("gear", "Up"),), changes=(StateChange("gear", "Moving", "Up"),))
    found = differences(skillset, Story((*finding.story.steps[:-1], wrong)))
    assert found == [(len(finding.story.steps), ("gear is Down in the managers, Up in the story",))]


def test_the_command(tmp_path, capsys):
    path = tmp_path / "example.rl"
    path.write_text(EXAMPLES["ALU510"])
    assert check_play.main(["--play", "1", str(path)]) == 0
    assert capsys.readouterr().out.endswith("the managers come to the same end\n")
    assert check_play.main(["--play", "1", "--json", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["agrees"]
    assert check_play.main(["--play", "2", str(path)]) == 2
    assert "there is no story 2" in capsys.readouterr().err
