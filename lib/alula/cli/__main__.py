"""The command ``alula`` of a pip installation: everything that needs no ROS. The entry script of a checkout has all the commands."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.common.robots import VARIABLE
from alula.common.suggestions import nearest

COMMANDS = {
    "check": ("alula.cli.check", "check skill models: errors and warnings, then proofs"),
    "odds": ("alula.cli.odds", "tell how likely a mission is accomplished, degraded, given up, or neither: alula odds FILE"),
    "tree": ("alula.cli.tree", "draw a mission, or tick it without any robot: alula tree FILE [--svg FILE] [--answers FILE]"),
    "palette": ("alula.cli.palette", "write a robot's skills as a palette for Groot2: alula palette FOLDER"),
    "new": ("alula.generate.scaffold.__main__", "make a robot: alula new robot FOLDER"),
    "run": ("alula.cli.run", "run a scenario over mocks, in virtual time: alula run SCENARIO --mock [--fail WHAT@SECONDS]"),
    "replay": ("alula.cli.replay", "make a recorded mission's decisions again, with one thing changed"),
    "expect": ("alula.cli.expect", "write a run's expectations, or check a run against them"),
    "conform": ("alula.cli.conform", "check a record against the models"),
    "compare": ("alula.cli.compare", "show runs side by side"),
    "campaign": ("alula.campaign.__main__", "run scenarios many times with faults, and report the responses to failures"),
    "console": ("alula.console.__main__", "serve the page of runs"),
    "editor": ("alula.editor.__main__", "serve editors over the standard streams (language server)"),
    "generate": ("alula.generate.__main__", "generate interfaces, managers and bridge configuration from a robot's models"),
}
ROBOT = "--robot"


def usage() -> str:
    """Return the help text: a line for each command."""
    lines = ["usage: alula [--robot DIR] COMMAND [arguments]", ""]
    lines += [f"  {name:<10} {about}" for name, (_, about) in COMMANDS.items()]
    return "\n".join([*lines, "", "What needs ROS (setup, fly, bridge, panel, test) is in the entry script ./alula of a checkout.", ""])


def without_robot(words: Sequence[str]) -> list[str]:
    """Return the words without ``--robot DIR``, which is noted in the environment; raises ValueError."""
    left, rest = [], list(words)
    while rest:
        word = rest.pop(0)
        name, equals, value = word.partition("=")
        if name != ROBOT:
            left.append(word)
            continue
        if not equals and not rest:
            raise ValueError("--robot: needs the robot's folder")
        folder = Path(value if equals else rest.pop(0)).expanduser()
        if not folder.is_dir():
            raise ValueError(f"--robot {folder}: is no folder")
        os.environ[VARIABLE] = str(folder.resolve())
    return left


def main(words: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code."""
    try:
        left = without_robot(sys.argv[1:] if words is None else words)
    except ValueError as error:
        sys.stderr.write(f"alula: {error}\n")
        return 2
    command, *arguments = left or ["help"]
    if command in {"help", "-h", "--help"}:
        sys.stdout.write(usage())
        return 0
    if command not in COMMANDS:
        sys.stderr.write(f"alula: there is no command '{command}'; {nearest(command, COMMANDS)}\n")
        return 2
    try:
        module = importlib.import_module(COMMANDS[command][0])
    except ModuleNotFoundError as error:
        sys.stderr.write(f"alula {command}: needs the Python package {error.name}; pip install 'alula[all]' brings it\n")
        return 2
    code: int = module.main(arguments)
    return code


if __name__ == "__main__":
    sys.exit(main())
