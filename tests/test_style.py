"""What the whole tree must satisfy: ruff and mypy --strict."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
# Each room's Python packages, type-checked together; generated packages and the tests are left to ruff.
ROS1_PACKAGES = (
    "uav_guidance",
    "resource_reporter",
    "alula_base",
    "node_core",
    "skillset_ros1",
    "perception_core",
    "zed_depth",
    "lidar_obstacles",
    "lidar_mapping",
    "uav_simulator",
    "uav_report",
    "uav_flight",
    "radio_link",
    "video_stream",
    "ground_station",
)
ROS2_PACKAGES = ("skillset_ros2", "skill_panel", "uav_skills", "uav_missions")
TYPED = [
    "lib/alula",
    *map(str, sorted((ALULA_ROOT / "examples").glob("e[0-9]*.py"))),
    "flight/alula_flight",
    "bridge/ros_bridge/ros_bridge",
    "tools/bridge_tools",
    "tools/skill_bench",
    "tools/decision_bench",
    "tools/start_bench",
    "tools/folder_bench",
    "tools/flight_bench",
    "tools/console_bench",
    "tools/perception_bench",
    "tools/prove_bench",
    "tools/growing_bench",
    "tools/repair_bench",
    "tools/planners_table",
    "tools/link_rig",
    "tools/groot_bench",
    "tools/finding_pages",
    "tools/log_mutations",
    "tools/mission_mutations",
    "tools/api_page",
    "tools/manual_site",
    "tools/key_tables",
    *(f"ros2_ws/src/{name}/{name}" for name in ROS2_PACKAGES),
    *(f"ros1_ws/src/{name}/src/{name}" for name in ROS1_PACKAGES),
    "examples/rover/ros2_ws/src/rover_robot/rover_robot",
    "examples/rover/ros1_ws/src/rover_simulator/src/rover_simulator",
    "examples/rover/ros1_ws/src/rover_navigation/src/rover_navigation",
]


ON_THE_ROBOT = [
    "ros1_ws/src/resource_reporter/src",
    "ros1_ws/src/alula_base/src",
    "ros1_ws/src/alula_base/scripts/dead_man",
    "ros1_ws/src/node_core/src/node_core/core.py",
    "ros1_ws/src/node_core/src/node_core/ros",
]
"""What runs on a robot's own computer, with Noetic's Python; annotations are not evaluated there."""
COMMANDS = {
    "lint": ["ruff", "check", "."],
    "format": ["ruff", "format", "--check", "."],
    "types": ["mypy", *TYPED],
    "oldest Python": ["vermin", "--target=3.8-", "--violations", "--no-tips", *ON_THE_ROBOT],
}


@pytest.mark.timeout(0)  # mypy without its cache takes two minutes of processor time: as long as the machine needs
@pytest.mark.parametrize("name", COMMANDS)
def test_tree_is_clean(name: str) -> None:
    done = subprocess.run(COMMANDS[name], cwd=ALULA_ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


@pytest.mark.timeout(0)
def test_a_type_checker_knows_the_public_names_and_no_others() -> None:
    program = (
        "from alula import Mission, parts\nfrom alula.trees import Action, register\nreveal_type(Mission.load)\nfrom alula import Misson"
    )
    done = subprocess.run(["mypy", "-c", program], cwd=ALULA_ROOT, capture_output=True, text=True, check=False)
    said = done.stdout.splitlines()
    assert [line for line in said if "error" in line and "Found" not in line] == [
        '<string>:4: error: Module "alula" has no attribute "Misson"; maybe "Mission"?  [attr-defined]'
    ]
    assert any("-> alula.api.mission.Mission" in line for line in said)


@pytest.mark.parametrize(
    ("language", "source"), [("skill", "skillsets/uav/navigation.skill"), ("python", "ros2_ws/src/uav_skills/uav_skills/navigation.py")]
)
def test_the_readme_shows_lines_of_the_product(language: str, source: str) -> None:
    """What a newcomer reads first is what runs: excerpts, in the order of the file."""
    shown = (ALULA_ROOT / "README.md").read_text().split(f"```{language}\n")[1].split("```")[0]
    lines = iter((ALULA_ROOT / source).read_text().splitlines())
    missing = [line for line in shown.splitlines() if line and line not in lines]
    assert not missing
