"""``alula completion SHELL``: print what a shell evaluates so that it completes; and complete, when such a shell asks.

A shell asks by calling ``alula`` with the line in its environment, as argcomplete has it. Options come from the table of commands, words
from the robot: scenarios, faults, skills with their inputs, resources, states.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import argcomplete
from argcomplete.completers import DirectoriesCompleter
from argcomplete.shell_integration import shellcode

from alula.cli.checkout import Checkout, checkout
from alula.cli.parser import Parser, words_completing
from alula.cli.table import COMMANDS, Command, parse
from alula.common.deployments import deployment_names
from alula.common.robots import RobotError, RobotFolder, find_robot
from alula.common.scenarios import ScenarioError, load_scenario, scenario_names

if TYPE_CHECKING:
    from alula.model.model import Skillset
    from alula.runtime.live.options import RunOption

# What only some words need is imported where they are asked for: a shell waits.
OPTIONS_S = 10.0
"""Wall clock, for a robot's own options where only a ROS world can import its part (3 s on a busy machine): a shell waits for it."""
NAMES = ("alula", "./alula")
HELP = ("-h", "--help")


def main(words: Sequence[str] | None = None) -> int:
    """Complete where a shell asks, else print what it is to evaluate; return the exit code."""
    if "_ARGCOMPLETE" in os.environ:
        argcomplete.autocomplete(parser_for(words_typed(), checkout()), exclude=HELP, always_complete_options=False)
        return 1
    shell = parse("completion", words).shell
    sys.stdout.write(shellcode(NAMES, shell=shell))
    return 0


def words_typed() -> list[str]:
    """Return the words of the line that a shell asks about, up to its cursor; the last one is what is being typed, and may be empty."""
    point = int(os.environ.get("COMP_POINT") or 0)
    line = os.environ.get("COMP_LINE", "")[:point]
    words = line.replace("'", "").replace('"', "").split()[1:]
    return words if words and not line[-1].isspace() else [*words, ""]


def parser_for(words: Sequence[str], here: Checkout | None) -> ArgumentParser:
    """Return a parser of the whole command line; of its commands only the one that is among the words knows what it takes."""
    top = Parser(prog="alula")
    _add_robot(top)
    commands = top.add_subparsers(dest="command")
    meant = next((word for word in words if word in COMMANDS), "")
    for name, command in COMMANDS.items():
        parser = commands.add_parser(name, help=command.about)
        if name == meant:
            _add_all(command, parser, here, words)
    return top


def _add_robot(parser: ArgumentParser) -> None:
    setattr(parser.add_argument("--robot", metavar="DIR"), "completer", DirectoriesCompleter())  # noqa: B010 - argcomplete's


def _add_all(command: Command, parser: ArgumentParser, here: Checkout | None, words: Sequence[str]) -> None:
    """Add everything that a command takes, with what completes it."""
    _add_robot(parser)
    if here is None:
        command.add_options(parser)
    else:
        here.add_options(command, parser)
    if "run" in {command.name, command.same_as} and _may_be_own(parser, words):
        _add_own(parser, here)
    for action in parser._actions:  # noqa: SLF001  (argparse offers no other way to look at what was declared)
        words = words_completing(action)
        if words:
            setattr(action, "completer", _Words(WORDS[words]))  # noqa: B010 - argcomplete's


def _may_be_own(parser: ArgumentParser, words: Sequence[str]) -> bool:
    """Return whether a line may hold an option of the robot's own, or is about to: only then the robot is asked, which takes a moment."""
    known = {name for action in parser._actions for name in action.option_strings}  # noqa: SLF001  (as above)
    return words[-1].startswith("-") or any(word.startswith("--") and word.partition("=")[0] not in known for word in words)


class _Words:
    """Completes an argument as argcomplete has it: by the robot's words, and nothing where it has none."""

    def __init__(self, words: Callable[[RobotFolder, Namespace], Iterable[str]]) -> None:
        self._words = words

    def __call__(self, parsed_args: Namespace, **_others: object) -> list[str]:
        try:
            return sorted(set(self._words(find_robot(), parsed_args)))
        except (RobotError, ScenarioError, OSError):
            return []


def _add_own(parser: ArgumentParser, here: Checkout | None) -> None:
    """Add the robot's own options of a run."""
    for option in own_options(here):
        if option.takes_value:
            parser.add_argument(f"--{option.name}", help=option.about, choices=option.choices or None)
        else:
            parser.add_argument(f"--{option.name}", help=option.about, action="store_true")


def own_options(here: Checkout | None) -> Sequence[RunOption]:
    """Return what the robot's part declares; what can't be known here is left out."""
    from alula.runtime.live.options import FLAG, offer_of, read_offer
    from alula.runtime.live.part import part_of_robot

    try:
        return offer_of(part_of_robot()).options
    except RobotError:
        pass
    if here is None or not here.has("ros1"):
        return []
    try:
        words = here.words_of("run", FLAG)
        return read_offer(subprocess.run(words, capture_output=True, text=True, check=True, timeout=OPTIONS_S).stdout).options
    except (subprocess.SubprocessError, OSError, ValueError, KeyError):
        return []


# --- words of the robot ------------------------------------------------------------------------------------------------


def _faults(robot: RobotFolder, _: Namespace) -> Iterable[str]:
    """Yield what can fail in mocks, in scenarios, and what the robot's file of faults names."""
    from alula.records.errors import AnalysisError
    from alula.records.mocks import behaviour_of
    from alula.runtime.core.errors import SkillRuntimeError

    with contextlib.suppress(AnalysisError, SkillRuntimeError):
        yield from behaviour_of(robot).faults
    yield from _in_file(robot)
    for name in scenario_names():
        yield from dict(load_scenario(name).faults)


def _in_file(robot: RobotFolder) -> Iterable[str]:
    from alula.records.causes.fault_file import effects_of
    from alula.records.errors import AnalysisError

    try:
        return effects_of(robot, _models(robot)).known
    except AnalysisError:
        return []


def _models(robot: RobotFolder) -> tuple[Skillset, ...]:
    from alula.language.fleet import in_fleet
    from alula.language.models import check_files, models_in

    if robot.robots:
        return tuple(one for name, member in robot.robots.items() for one in in_fleet(name, _models(member)))
    return tuple(skillset for file in check_files(models_in(str(robot.skillsets))) for skillset in file.skillsets)


def _skills(robot: RobotFolder, _: Namespace) -> Iterable[str]:
    """Yield each skill as ``skillset.skill``, and alone."""
    for skillset in _models(robot):
        for skill in skillset.skills:
            yield from (f"{skillset.name}.{skill.name}", skill.name)


def _inputs(robot: RobotFolder, given: Namespace) -> Iterable[str]:
    """Yield ``key=`` of each input of the skill that the line names."""
    for skillset in _models(robot):
        for skill in skillset.skills:
            if given.skill in {skill.name, f"{skillset.name}.{skill.name}"}:
                yield from (f"{one.name}=" for one in skill.inputs)


def _resources(robot: RobotFolder, _: Namespace) -> Iterable[str]:
    return (f"{skillset.name}.{resource.name}" for skillset in _models(robot) for resource in skillset.resources)


def _states(robot: RobotFolder, given: Namespace) -> Iterable[str]:
    return (
        state
        for skillset in _models(robot)
        for resource in skillset.resources
        if given.resource == f"{skillset.name}.{resource.name}"
        for state in resource.states
    )


WORDS: Mapping[str, Callable[[RobotFolder, Namespace], Iterable[str]]] = {
    "commands": lambda _robot, _given: COMMANDS,
    "data": lambda robot, _: (f"{skillset.name}.{one.name}" for skillset in _models(robot) for one in skillset.data),
    "faults": _faults,
    "inputs": _inputs,
    "nothing": lambda _robot, _given: (),
    "resources": _resources,
    "deployments": lambda robot, _given: deployment_names(robot),
    "scenarios": lambda _robot, _given: scenario_names(),
    "skills": _skills,
    "skillsets": lambda robot, _: (one.name for one in _models(robot)),
    "states": _states,
    "units": lambda robot, _: (f"{name}=" for name in _in_file(robot)),
    "worlds": lambda robot, _: (path.stem for path in robot.worlds.glob("*.yaml")),
}
"""What completes an argument, by the name that `completed_by` gave it: from the robot, and what the line says so far."""


if __name__ == "__main__":
    sys.exit(main())
