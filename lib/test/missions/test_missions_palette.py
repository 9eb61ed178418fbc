"""A robot's skills as a palette for Groot2."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET

import pytest

pytest.importorskip("py_trees")

from alula.cli import palette
from alula.trees.reading import read_models

MODEL = """
skillset arm {
  type Pose
  resource hand { initial OPEN  OPEN -> CLOSED  CLOSED -> OPEN }

  // Close the hand about a thing,
  // as gently as can be.
  //
  // How it does that is the hand's own.
  skill grip {
    input {
      at: Pose // where the thing is
      force: float64 // N, > 0
      tries: int32
      hard: bool
    }
    effect { close: hand -> CLOSED }
    precondition { open: resource = (hand == OPEN) success close }
    result { HELD: apply = close  DROPPED: apply = close }
  }
}
"""

NODES = """
from alula.parts import MissionPart
from alula.trees import SUCCESS, SyncAction, register


@register("arm.Choose")
class Choose(SyncAction):
    def update(self):
        return SUCCESS


PART = MissionPart((Choose,))
"""


@pytest.fixture
def written(tmp_path, capsys):
    (tmp_path / "arm.skill").write_text(MODEL)
    assert palette.main([str(tmp_path)]) == 0
    return capsys.readouterr().out


def test_skills_are_actions_and_resources_conditions(written):
    model = ET.fromstring(written).find("TreeNodesModel")  # noqa: S314 - our own
    assert [(one.tag, one.get("ID")) for one in model if "." in one.get("ID")] == [("Action", "arm.grip"), ("Condition", "arm.hand")]
    grip, hand = model.find("*[@ID='arm.grip']"), model.find("*[@ID='arm.hand']")
    ports = [(port.tag, port.get("name"), port.get("type"), port.get("default"), port.text) for port in grip if port.get("name")]
    assert ports == [
        ("input_port", "at", "Pose", None, "where the thing is"),
        ("input_port", "force", "double", None, "N, > 0"),
        ("input_port", "tries", "int", None, None),
        ("input_port", "hard", "bool", None, None),
        ("input_port", "success", "std::string", "HELD", "results that mean success, of HELD, DROPPED"),
        ("input_port", "halt_waits", "bool", "false", "when it is halted, no skill of any skillset starts until it has ended"),
        ("output_port", "outcome", "std::string", None, "why it ended: its result, or how it failed"),
    ]
    assert grip.find("MetadataFields/Metadata").get("description") == "Close the hand about a thing, as gently as can be."
    assert [(port.get("name"), port.text) for port in hand if port.get("name")] == [("state", "one of OPEN, CLOSED")]


def test_it_reads_back_as_a_palette(written, tmp_path):
    (tmp_path / "nodes.xml").write_text(written)
    types = read_models(tmp_path / "nodes.xml")
    assert {"arm.grip", "arm.hand"} <= set(types.names())
    assert types.get("arm.grip").ports["success"].default == "HELD"


def test_nodes_of_alula_and_of_the_robot_are_in_it_and_those_that_groot_has_are_not(tmp_path, capsys, monkeypatch):
    (tmp_path / "robot.yaml").write_text("name: robot\nskillsets: models\npython: [code]\nparts: {missions: 'arm_nodes:PART'}\n")
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "arm.skill").write_text(MODEL)
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "arm_nodes.py").write_text(NODES)
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert palette.main([str(tmp_path / "models")]) == 0
    model = ET.fromstring(capsys.readouterr().out).find("TreeNodesModel")  # noqa: S314 - our own
    kinds = {one.get("ID"): one.tag for one in model}
    assert kinds["arm.Choose"] == "Action"
    assert (kinds["Until"], kinds["WaitFor"]) == ("Decorator", "Action")
    assert not {"Sequence", "Script"} & set(kinds)


def test_models_that_are_wrong_are_told(tmp_path, capsys):
    assert palette.main([str(tmp_path / "none")]) == 2
    assert "none" in capsys.readouterr().err
    (tmp_path / "arm.skill").write_text("skillset arm { resource")
    assert palette.main([str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "arm.skill:1:" in err
