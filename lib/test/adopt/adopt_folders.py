"""Folders of trees, and what is made of them, for tests."""

from __future__ import annotations

from pathlib import Path

from alula.cli import new
from alula.cli.tree import mains

MAIN = """<root BTCPP_format="4" main_tree_to_execute="Deliver">
  <!-- Brings a cup. -->
  <BehaviorTree ID="Deliver">
    <Sequence>
      <SubTree ID="Enter" room="{kitchen}"/>
      <Grasp object="{item}" force="5" Pose="{pose}" if="x"/>
      <Careful limit="2.5"><MoveTo goal="{pose}" at="{at}"/></Careful>
      <Condition ID="IsAt" name="in the hall" room="hall"/>
      <Inverter><IsAt name="in the kitchen" room="kitchen"/></Inverter>
      <Track target="{at}"/>
    </Sequence>
  </BehaviorTree>
  <TreeNodesModel>
    <Action ID="MoveTo">
      <input_port name="goal" type="std::string">where to</input_port>
      <input_port name="speed" type="double" default="0.5">m/s</input_port>
      <output_port name="at" type="geometry_msgs::Pose"/>
    </Action>
    <Condition ID="IsDoorOpen"/>
    <Action ID="Track"><inout_port name="target"/></Action>
  </TreeNodesModel>
</root>
"""
DOOR = """<root BTCPP_format="4">
  <!-- Whoever is in the hall. -->
  <BehaviorTree ID="Enter">
    <Fallback>
      <IsDoorOpen/>
      <OpenDoor/>
    </Fallback>
  </BehaviorTree>
</root>
"""


def folder_of(tmp_path: Path, **files: str) -> Path:
    """Write files of trees, by their names without the ending, into a folder."""
    folder = tmp_path / "trees"
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / f"{name}.xml").write_text(text, encoding="utf-8")
    return folder


def tree(*nodes: str, name: str = "Main", rest: str = "", root: str = ' BTCPP_format="4"') -> str:
    """Return a file with one tree, a sequence of nodes."""
    return f'<root{root}><BehaviorTree ID="{name}"><Sequence>{"".join(nodes)}</Sequence></BehaviorTree>{rest}</root>'


def made(tmp_path: Path, *options: str, **files: str) -> Path:
    """Have a robot made of files of trees; return its folder."""
    robot = tmp_path / "rover"
    assert new.main(["robot", str(robot), "--from-trees", str(folder_of(tmp_path, **files)), *options]) == 0
    return robot


def mains_of(folder: Path) -> list:
    """Return the main trees of a folder."""
    wrong = []
    return list(mains([folder], "", {}, wrong.append))
