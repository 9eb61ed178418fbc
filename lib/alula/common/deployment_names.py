"""The names of a robot's deployments, read without any package: the command line refuses a wrong one before anything is built."""

from __future__ import annotations

from pathlib import Path

from alula.common.suggestions import nearest

FOLDER = "deployments"


def names_in(robot: Path) -> list[str]:
    """Return the names of the deployments in a robot's folder, sorted."""
    return sorted(path.stem for path in (robot / FOLDER).glob("*.yaml"))


def why_no_deployment(name: str, robot: Path) -> str:
    """Return why a robot's folder has no deployment of this name, and which it has; empty: it has it."""
    names = names_in(robot)
    if name in names:
        return ""
    hint = nearest(name, names) or (
        f"there are {', '.join(names)}" if names else "write one: docs/how-to/on-the-robot.md says what is in it"
    )
    return f"there is no deployment '{name}' in {robot / FOLDER}; {hint}"
