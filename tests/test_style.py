"""What the whole tree must satisfy: ruff, mypy --strict, and sentences that name their subject."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ALULA_ROOT = Path(__file__).resolve().parents[1]
# Each room's Python packages, type-checked together; generated packages and the tests are left to ruff.
ROS1_PACKAGES = (
    "uav_guidance",
    "resource_reporter",
    "skillset_ros1",
    "perception_core",
    "zed_depth",
    "lidar_obstacles",
    "lidar_mapping",
    "uav_simulator",
    "radio_link",
    "video_stream",
    "ground_station",
)
ROS2_PACKAGES = (
    "alula_common",
    "skill_model",
    "skill_language",
    "skill_runtime",
    "skill_panel",
    "mission_console",
    "skill_missions",
    "mission_replay",
    "uav_skills",
    "uav_missions",
    "run_analysis",
)
TYPED = [
    "flight/alula_flight",
    "flight/sensor_replay",
    "bridge/ros_bridge/ros_bridge",
    "tools/bridge_tools",
    "tools/skill_bench",
    "tools/perception_bench",
    "tools/log_mutations",
    *(f"ros2_ws/src/{name}/{name}" for name in ROS2_PACKAGES),
    *(f"ros1_ws/src/{name}/src/{name}" for name in ROS1_PACKAGES),
]


COMMANDS = {"lint": ["ruff", "check", "."], "format": ["ruff", "format", "--check", "."], "types": ["mypy", *TYPED]}


@pytest.mark.parametrize("name", COMMANDS)
def test_tree_is_clean(name: str) -> None:
    done = subprocess.run(COMMANDS[name], cwd=ALULA_ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


@pytest.mark.parametrize(
    ("language", "source"), [("skill", "skillsets/uav/navigation.skill"), ("python", "ros2_ws/src/uav_skills/uav_skills/navigation.py")]
)
def test_the_readme_shows_lines_of_the_product(language: str, source: str) -> None:
    """What a newcomer reads first is what runs: excerpts, in the order of the file."""
    shown = (ALULA_ROOT / "README.md").read_text().split(f"```{language}\n")[1].split("```")[0]
    lines = iter((ALULA_ROOT / source).read_text().splitlines())
    missing = [line for line in shown.splitlines() if line and line not in lines]
    assert not missing


# "Who" belongs to people. A program, a node, a caller is "that"; a sentence about an unnamed person is a riddle.
UNNAMED = re.compile(
    r"(?<![a-z])(?:(?:some|any|every|no)(?:body|one)|no[\s-]+one(?!-)|whoever|whom(?:ever)?|(?:(?P<noun>[a-z]+)\s+)?who)(?![a-z])",
    re.IGNORECASE,
)
PEOPLE = {"developers", "newcomer", "operator", "people", "pilot", "telepilot", "user", "users"}
# What stands between the words of a sentence: a comment's mark on its next line, and `_` in a name.
BETWEEN_WORDS = re.compile(r"^[ \t#/*>-]+|_", re.MULTILINE)
BUILT = {"__pycache__", "runs", "node_modules"}
EXEMPT = {"LICENSE", "tests/test_style.py"}  # a text that is not ours; the words themselves


def unnamed_subjects(text: str) -> list[int]:
    """Return the lines with a subject that is an unnamed person."""
    plain = BETWEEN_WORDS.sub(lambda between: " " * len(between[0]), text)
    found = (match for match in UNNAMED.finditer(plain) if (match["noun"] or "").lower() not in PEOPLE)
    return [plain.count("\n", 0, match.end()) + 1 for match in found]


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("# what nobody asked for", [1]),
        ("def test_a_hook_holds_up_nobody():", [1]),
        ("a stop that no\n# one wants", [2]),
        ("Whoever asks", [1]),
        ("results for those\n    # who come late", [2]),
        ("it waits: who has gone is forgotten", [1]),
        ("the pilot who flies, developers\n// who build", []),
        ("no one-line form; a body whose mass is known; the whole", []),
    ],
)
def test_unnamed_subjects_are_found(text: str, lines: list[int]) -> None:
    assert unnamed_subjects(text) == lines


def texts() -> Iterator[tuple[str, str]]:
    """Yield name and text of each file; without git, which an image of the project does not have."""
    for folder, folders, names in os.walk(ALULA_ROOT):
        folders[:] = sorted(name for name in folders if name not in BUILT and (name == ".ci" or not name.startswith(".")))
        for path in (Path(folder) / name for name in sorted(names)):
            with contextlib.suppress(UnicodeDecodeError):
                yield str(path.relative_to(ALULA_ROOT)), path.read_text(encoding="utf-8")


def test_every_sentence_names_its_subject() -> None:
    riddles = [
        f"{name}:{line}: {text.splitlines()[line - 1].strip()}"
        for name, text in texts()
        if name not in EXEMPT
        for line in unnamed_subjects(text)
    ]
    assert not riddles, "\n".join(riddles)
