"""The table of all commands, in the order of the help. A command is described here, and what it takes in ``alula.cli.options``."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from alula.cli.options import live, models, runs
from alula.cli.parser import Parser

VERSION = "0.3.0"


_OF_THE_FRONT = {"help", "version"}


class Needs(Enum):
    """What has to be there before a command can begin; a checkout makes it first."""

    NOTHING = "nothing"
    PACKAGES = "packages"  # Python's, of ROS 2's world; nothing that is built of a robot: its model may be broken
    BUILD = "build"


@dataclass(frozen=True)
class Command:
    """A command.

    Attributes:
        name: the word that it is called by.
        about: what it does, in a line that begins with a verb.
        options: adds what it takes to a parser; None: its words are another program's, which knows them.
        module: the module of the library that does it; empty: only a checkout has it.
        needs: what it needs in a checkout.
        robot: whether it is about a robot, and nothing can be done without one.
        packages_with: the option with which the library's module does it, and packages are enough.
        same_as: the command that this one is another name of.
        open: what it takes besides is known to the robot, or to the program that it starts; only that can print its help.
    """

    name: str
    about: str
    options: Callable[[ArgumentParser], None] | None = None
    module: str = ""
    needs: Needs = Needs.BUILD
    robot: bool = False
    packages_with: str = ""
    same_as: str = ""
    open: bool = False

    @property
    def anywhere(self) -> bool:
        """Return whether a pip installation has it, too."""
        return bool(self.module) or self.name in _OF_THE_FRONT

    @property
    def elsewhere(self) -> str:
        """Return what to say of it in a pip installation that does not have it."""
        why = "needs ROS, which pip does not bring" if self.needs is Needs.BUILD else "is about a checkout of Alula"
        hint = "; what of a robot's tests needs no ROS is run by: python -m pytest tests" if self.name == "test" else ""
        return f"{why}: clone Alula's repository, and use its entry script ./alula{hint}"

    def parser(self) -> Parser:
        """Return the parser of its words."""
        parser = Parser(prog=f"alula {self.same_as or self.name}", description=f"{self.about[0].upper()}{self.about[1:]}.")
        self.add_options(parser)
        return parser

    def add_options(self, parser: ArgumentParser) -> None:
        """Add what it takes to a parser."""
        if self.options is not None:
            self.options(parser)


def _models(name: str, about: str, options: Callable[[ArgumentParser], None]) -> Command:
    return Command(name, about, options, f"alula.cli.{name}", Needs.PACKAGES)


def _records(name: str, about: str, options: Callable[[ArgumentParser], None], *, robot: bool = False) -> Command:
    return Command(name, about, options, f"alula.cli.{name}", robot=robot)


def _run(name: str, about: str, same_as: str = "") -> Command:
    return Command(name, about, runs.run, "alula.cli.run", robot=True, packages_with="--mock", same_as=same_as, open=True)


GROUPS: dict[str, Sequence[Command]] = {
    "A robot": (
        Command("setup", "install and build everything that is missing: Alula, then the robot's own part", None, needs=Needs.NOTHING),
        _models("new", "make a robot, a working repository: model, types, hooks, mission, tests", models.new),
        Command("test", "run the robot's tests, in Alula's checkout its own: [--quick] [pytest arguments]", None, robot=True, open=True),
        Command(
            "doctor",
            "report what is missing of the installation, or wrong with a deployment, and how to mend it",
            live.doctor,
            needs=Needs.NOTHING,
        ),
    ),
    "Missions": (
        _run("run", "run a mission live, in a ROS graph of its own; with --mock over mocks, in a second"),
        _run("fly", "run a mission: the same as run", same_as="run"),
        _records("replay", "make the decisions of a recorded mission again, with one thing changed", runs.replay, robot=True),
        _records("campaign", "run scenarios many times with faults, and report the response to each failure", runs.campaign, robot=True),
    ),
    "Models and trees": (
        _models("check", "check skill models and missions: errors and warnings with their places, then proofs", models.check),
        _models("odds", "compute how likely a mission is accomplished, degraded, given up, or neither", models.odds),
        _models("repair", "write and prove the fallback branch that a mission lacks for a fault or a counterexample", models.repair),
        _models("plan", "write and prove a mission that reaches a goal, from nothing", models.plan),
        _models("tree", "draw a mission; with answers tick it without any robot", models.tree),
        _models("palette", "write a robot's skills as a TreeNodesModel for Groot2", models.palette),
        _models("generate", "make interfaces, managers and the bridge's configuration from a robot's skill models", models.generate),
        _models("editor", "serve editors over the standard streams (language server): findings, completion, names", models.editor),
    ),
    "A running robot": (
        Command("console", "serve the operator's page: start a mission, watch it, understand it", live.console, "alula.cli.console"),
        Command(
            "up", "start the parts of a deployment that stay up between missions: bridge, managers, recorder, page", live.up, robot=True
        ),
        Command("down", "end the parts that up has started", live.down, robot=True),
        Command("status", "show the state of a deployment's parts", live.status, robot=True),
        Command("service", "have systemd keep a deployment up: install, remove, or print its unit", live.service, robot=True),
        Command("panel", "show running skillsets in the terminal, and control them manually", live.panel),
        Command("skills", "list the skills, resources and data of running skillsets, with their states", live.talking()),
        Command("start", "run a skill to its end; Ctrl-C interrupts it", live.talking(live.skill, live.inputs)),
        Command("interrupt", "interrupt all executions of a skill", live.talking(live.skill)),
        Command("events", "show executions and transitions, as they were or as they happen", live.talking(live.events)),
        Command("why", "say what keeps a skill from starting", live.talking(live.skill, live.inputs)),
        Command("transition", "make an extern transition, as the functional layer does", live.talking(live.state)),
        Command("data", "show the values of data", live.talking(live.data)),
        Command("mock", "serve a robot's skillsets as mocks on ROS 2: the same interface, scripted behaviour", live.mock),
        Command("bridge", "bridge topics, services and actions between ROS 1 and ROS 2", None, open=True),
    ),
    "Records of runs": (
        _records("expect", "write expectations from a run, or check a run against them", runs.expect),
        _records("conform", "check a run, a record or a bag against the models: they must allow every event", runs.conform),
        _records("compare", "show runs side by side, and whether their missions made the same decisions", runs.compare),
    ),
    "Alula itself": (
        Command("bench", "measure what a part costs; one part after the other without a name", None, open=True),
        _models("completion", 'print completion for a shell: eval "$(alula completion bash)"', models.completion),
        Command("help", "list the commands, or say what one of them takes", models.command, needs=Needs.NOTHING),
        Command("version", "print the version", None, needs=Needs.NOTHING),
    ),
}
COMMANDS = {command.name: command for commands in GROUPS.values() for command in commands}


def parser_of(name: str) -> Parser:
    """Return the parser of a command's words."""
    return COMMANDS[name].parser()


def parse(name: str, words: Sequence[str] | None) -> Any:
    """Return the values of a command's words (None: the process's); wrong ones end the process with exit code 2."""
    return parser_of(name).parse_args(words)
