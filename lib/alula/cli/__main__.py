"""``alula COMMAND [arguments] [--robot DIR]``: the front of a checkout and of a pip installation.

1. find the robot                3. read its words: help, or what is wrong with them
2. find the command              4. hand over: to what the checkout has, else to the library's module

It needs nothing but Python itself, so that a bare machine can be told what to do.
"""

from __future__ import annotations

import importlib
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from alula.cli.checkout import ROBOT, Checkout, checkout
from alula.cli.help import usage
from alula.cli.parser import WRONG, Parser
from alula.cli.table import COMMANDS, VERSION, Command
from alula.common.deployment_names import why_no_deployment
from alula.common.suggestions import nearest

OPTION = "--robot"
ROBOT_FILE = "robot.yaml"
MAKE_ONE = "make one: alula new robot DIR"
COMPLETING = "_ARGCOMPLETE"
"""Set by a shell that asks for completions: of the line in COMP_LINE, not of this process's words."""
_OTHER_WORDS = {"-h": "help", "--help": "help", "--version": "version"}


class WordsError(Exception):
    """The command line can't be; the message says why, and what would be right."""


def split_robot(words: Sequence[str]) -> tuple[list[str], str | None]:
    """Return the words without ``--robot DIR``, and the folder; None where none is named. Raises WordsError."""
    left: list[str] = []
    named: str | None = None
    rest = iter(words)
    for word in rest:
        name, equals, value = word.partition("=")
        if name != OPTION:
            left.append(word)
            continue
        named = value if equals else next(rest, None)
        if not named:
            raise WordsError(f"{OPTION} needs a folder")
    return left, named


def find_robot(named: str | None) -> Path | None:
    """Return the robot's folder: the one that is named, that of the calling process, or the one from here upwards. Raises WordsError."""
    if named is not None:
        folder = Path(named).expanduser()
        if not (folder / ROBOT_FILE).is_file():
            raise WordsError(f"{OPTION} {named}: there is no {ROBOT_FILE} in it; name a robot's folder, or {MAKE_ONE}")
        return folder.resolve()
    if os.environ.get(ROBOT):
        return Path(os.environ[ROBOT]).resolve()
    here = Path.cwd()
    return next((folder for folder in (here, *here.parents) if (folder / ROBOT_FILE).is_file()), None)


def find_command(name: str) -> Command:
    """Return a command; raises WordsError."""
    command = COMMANDS.get(_OTHER_WORDS.get(name, name))
    if command is None:
        hint = nearest(name, COMMANDS) or "'alula help' lists the commands"
        raise WordsError(f"there is no command '{name}'; {hint}")
    return command


def do(command: Command, words: Sequence[str], robot: Path | None, here: Checkout | None) -> int:
    """Do a command, as far as it is not the library's; return the exit code. Raises WordsError."""
    if not command.open:
        command.parser().parse_args(words)  # before anything is set up: what is wrong, or --help, ends the process
    if command.name == "help":
        sys.stdout.write(find_command(words[0]).parser().format_help() if words else usage())
        return 0
    if command.name == "version":
        sys.stdout.write(f"alula {VERSION}\n")
        return 0
    if command.robot and robot is None:
        raise WordsError(f"there is no {ROBOT_FILE} in {Path.cwd()} or above; name the robot's folder with {OPTION} DIR, or {MAKE_ONE}")
    if here is None and not command.module:
        raise WordsError(f"{command.name}: {command.elsewhere}")
    why = next((why for name in deployments_in(command, words) if robot and (why := why_no_deployment(name, robot))), "")
    if why:
        raise WordsError(why)
    return here.do(command, words) if here is not None else run_module(command, words)


def deployments_in(command: Command, words: Sequence[str]) -> list[str]:
    """Return the deployments that a command's words name."""
    parser = command.parser()
    named = parser.completed_by("deployments")
    if not named:
        return []
    if not command.open:
        given = parser.parse_args(words)
    else:  # the robot's own options are not known yet
        options = Parser(prog=parser.prog, add_help=False, allow_abbrev=False)
        for action in named:
            options.add_argument(*action.option_strings, dest=action.dest, default=action.default)
        given, _ = options.parse_known_args(words)
    values = [getattr(given, action.dest) for action in named]
    return [name for name in (value[-1] if isinstance(value, list) else value for value in values) if name]


def run_module(command: Command, words: Sequence[str]) -> int:
    """Run the library's module of a command in this process; return its exit code."""
    try:
        module = importlib.import_module(command.module)
    except ModuleNotFoundError as error:
        sys.stderr.write(f"alula {command.name}: needs the Python package {error.name}; pip install 'alula[all]' brings it\n")
        return WRONG
    code: int = module.main(words)
    return code


def complete(here: Checkout | None) -> int:
    """Tell a shell how its line goes on; nothing where the packages that this needs are not there yet."""
    try:
        _, named = split_robot(shlex.split(os.environ.get("COMP_LINE", ""))[1:])
        os.environ[ROBOT] = str(find_robot(named) or "")
    except (ValueError, WordsError):
        pass  # a line that is not finished: completed as far as it goes, with the robot of this folder
    command = COMMANDS["completion"]
    if here is None:
        return run_module(command, [])
    if here.has("venv2"):
        here.become(2, command.module)
    return 1


def main(words: Sequence[str] | None = None) -> int:
    """Do what the command line says; return the exit code."""
    here = checkout()
    if COMPLETING in os.environ:
        return complete(here)
    try:
        left, named = split_robot(sys.argv[1:] if words is None else words)
        robot = find_robot(named)
        if here is not None or named is not None:
            os.environ[ROBOT] = str(robot or "")
        name, *others = left or ["help"]
        return do(find_command(name), others, robot, here)
    except WordsError as error:
        sys.stderr.write(f"alula: {error}\n")
        return WRONG
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
