"""The robots of this checkout: a folder of ``skillsets`` each, with the models of its skillsets and what goes with them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

MODELS = ("*.skill", "*.rl")
BEHAVIOUR, FAULTS = "mock.yaml", "faults.yaml"
_SKILLSET = re.compile(r"^\s*skillset\s+(\w+)", re.MULTILINE)


@dataclass(frozen=True)
class RobotFolder:
    """A robot's folder, and the names of its skillsets."""

    path: Path
    skillsets: tuple[str, ...]

    def file(self, name: str) -> Path | None:
        """Return a file that goes with the models; None where the robot has none."""
        path = self.path / name
        return path if path.is_file() else None


def robot_of(skillsets: Iterable[str], folder: Path | None = None) -> RobotFolder | None:
    """Return the robot that has one of these skillsets, None where none of this checkout has; ``folder``: that of all robots."""
    wanted = set(skillsets)
    for path in sorted((folder or Path(os.environ.get("ALULA_ROOT", ".")) / "skillsets").glob("*/")):
        texts = [file.read_text(encoding="utf-8", errors="replace") for pattern in MODELS for file in sorted(path.glob(pattern))]
        found = tuple(name for text in texts for name in _SKILLSET.findall(text))
        if wanted & set(found):
            return RobotFolder(path, found)
    return None


def behaviour_files(skillsets: Iterable[str]) -> list[Path]:
    """Return the file that says what the mocks of these skillsets' robot do, none where it has none."""
    robot = robot_of(skillsets)
    file = None if robot is None else robot.file(BEHAVIOUR)
    return [] if file is None else [file]
