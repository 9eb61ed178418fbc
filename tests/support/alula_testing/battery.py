"""A robot that tells its battery as a message of its own, whose fields conditions ask for."""

from __future__ import annotations

from pathlib import Path

BATTERY = """
# What is left.
Header header
float64 level            # 0 to 1
float32[4] cells
uint8 CHARGING=1
uint8 state 1
string<=20 maker "none"
bool charging
rover_msgs/Cell first
other_msgs/Other other
Cell[] all
"""


def make_robot(folder: Path) -> Path:
    """Make the folder a robot whose type `Battery` is a message of its workspace; return it."""
    package = folder / "ros2_ws/src/rover_msgs/msg"
    package.mkdir(parents=True)
    (package / "Battery.msg").write_text(BATTERY, encoding="utf-8")
    (package / "Cell.msg").write_text("float64 volts\n", encoding="utf-8")
    (folder / "skillsets").mkdir()
    (folder / "skillsets/types.yaml").write_text("Battery: rover_msgs/Battery\n", encoding="utf-8")
    (folder / "robot.yaml").write_text("name: rover\n", encoding="utf-8")
    return folder
