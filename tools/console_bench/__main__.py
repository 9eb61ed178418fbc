"""`python -m console_bench FOLDER [--ros-args ...]`: a real mission's process, ticked as any other; its record goes to the folder."""

from __future__ import annotations

import sys
from pathlib import Path

from alula.missions.mission_file import plan_of_file
from alula.missions.part import NO_PART
from skillset_ros2.mission_node import run_mission

ENDLESS = """
<root BTCPP_format="4" main_tree_to_execute="bench">
  <BehaviorTree ID="bench"><WaitFor name="for ever" if="false"/></BehaviorTree>
  <BehaviorTree ID="stop_here"><AlwaysSuccess name="at rest"/></BehaviorTree>
</root>
"""


def main(folder: Path) -> int:
    """Run a mission whose only leaf runs for ever."""
    path = folder / "bench.xml"
    path.write_text(ENDLESS, encoding="utf-8")
    return run_mission(plan_of_file(path, "bench", (), {}, NO_PART), folder, [sys.argv[0], *sys.argv[2:]])


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
