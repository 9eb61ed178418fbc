"""The help of all commands, on the terminal and as a page; ``python -m alula.cli.help docs/reference`` writes the page there."""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from alula.cli.checkout import Checkout, checkout
from alula.cli.parser import Parser
from alula.cli.table import COMMANDS, GROUPS, Command

PAGE = "commands.md"
_WIDTH = 12
_HEAD = """# Commands

For everybody who uses Alula: what `./alula` of a checkout can do. `alula` of a pip installation is the same command
line, and says of what needs ROS that it does.

The robot is the folder with `robot.yaml` from the current one upwards, or `--robot DIR`, anywhere on the command line.
Commands set up first if needed. Results go to standard output, everything else to standard error. Exit codes: 0, done,
and what was asked is so; 1, it is not so (a property fails, a mission was given up, decisions differ); 2, it can't be
asked: one line on standard error says why, with the nearest word that is known.

`eval "$(./alula completion bash)"` in `~/.bashrc` completes commands, options, scenarios, faults, skills with their
inputs, resources and states of the robot. In `~/.zshrc` it is `eval "$(./alula completion zsh)"` behind `compinit`, in
fish's `config.fish` `./alula completion fish | source`.

<!-- Below this line: written by `python -m alula.cli.help docs/reference`, from the table of commands. -->
"""
_FOOT = """Commands set up first if needed. Results go to standard output, everything else to standard error.
'alula COMMAND --help' lists what a command takes; with a robot's run that is also what the robot adds.
"""


def usage() -> str:
    """Return the text that ``alula help`` prints: what there is here, a line for each command."""
    here = checkout() is not None
    lines = ["usage: alula COMMAND [arguments] [--robot DIR]", "", "The robot is the folder with robot.yaml from here upwards, or DIR.", ""]
    for title, commands in GROUPS.items():
        there = [command for command in commands if here or command.anywhere]
        lines += [f"{title}:", *(f"  {command.name:<{_WIDTH}}{command.about}" for command in there), ""] if there else []
    if not here:
        others = ", ".join(name for name, command in COMMANDS.items() if not command.anywhere)
        lines += [f"The entry script ./alula of a checkout has besides: {others}.", ""]
    return "\n".join([*lines, _FOOT])


def page(here: Checkout) -> str:
    """Return the page of all commands of a checkout."""
    parts = [_HEAD]
    for title, commands in GROUPS.items():
        parts.append(f"## {title}\n")
        parts += ["\n".join(_section(command, here)) for command in commands]
    return "\n".join(parts)


def _section(command: Command, here: Checkout) -> Iterator[str]:
    yield f"### {command.name}\n"
    yield from textwrap.wrap(f"{command.about[0].upper()}{command.about[1:]}.", 118)
    yield ""
    if command.same_as:
        return
    parser = Parser(prog=f"alula {command.name}")
    here.add_options(command, parser)
    words = " ".join(parser.format_usage().removeprefix("usage: ").replace(" [-h]", "").split())
    yield from textwrap.wrap(words, 112, initial_indent=" " * 4, subsequent_indent=" " * 8, break_long_words=False, break_on_hyphens=False)
    yield ""
    rows = [line for action in parser._actions for line in _row(action)]  # noqa: SLF001  (argparse offers no other way to look at it)
    if rows:
        yield from rows
        yield ""


def _row(action: argparse.Action) -> Iterator[str]:
    """Yield the lines about one argument."""
    if "--help" not in action.option_strings:
        value = "" if action.nargs == 0 else str(action.metavar or "|".join(map(str, action.choices or ())) or action.dest.upper())
        name = " ".join([*action.option_strings[-1:], *([value] if value else [])])
        yield from textwrap.wrap(
            f"- `{name}`: {action.help or ''}", 118, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )


def main() -> int:
    """Write the page into the folder that is named; return the exit code."""
    here = checkout()
    if here is None:
        sys.stderr.write("the page is about a checkout: run this by setup/in_ros2\n")
        return 2
    (Path(sys.argv[1]) / PAGE).write_text(page(here), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
