"""What a checkout has besides the library: a set-up, two ROS worlds with commands in them, benches, tests.

``setup/commands.toml`` says which command is done by which module in which world: the library knows nothing of what stands on it.
"""

from __future__ import annotations

import functools
import importlib
import os
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from alula.cli.parser import WRONG
from alula.cli.table import Command, Needs, parse
from alula.common.suggestions import nearest

ROOT, STATE, ROBOT = "ALULA_ROOT", "ALULA_STATE", "ALULA_ROBOT"
"""Variables: the checkout, which its entry script names; what its set-up made; the robot's folder, empty where there is none."""
FILE = "setup/commands.toml"
BUILT = "ros2"
"""The last step of the set-up."""


class SetupError(Exception):
    """The set-up of what a command needs has failed; it has said why."""


@dataclass(frozen=True)
class Handler:
    """What does a command in a checkout.

    Attributes:
        world: 1 or 2: the ROS world that it runs in.
        module: of Python; its words are the command's.
        named: whether it does several commands, and the first of its words is the command's name.
        words: what comes before the words that are given; ``{root}`` is the checkout.
        options: ``module:function`` which adds the command's options to a parser, where the table doesn't know them.
        path: folder of the checkout that holds that module.
    """

    world: int
    module: str
    named: bool = False
    words: tuple[str, ...] = ()
    options: str = ""
    path: str = ""


@dataclass(frozen=True)
class Checkout:
    """A checkout of Alula."""

    root: Path

    @property
    def state(self) -> Path:
        """Return the folder of what the set-up made."""
        return Path(os.environ.get(STATE) or self.root / ".alula")

    @functools.cached_property
    def _file(self) -> Mapping[str, Any]:
        import tomllib

        return tomllib.loads((self.root / FILE).read_text(encoding="utf-8"))

    @functools.cached_property
    def handlers(self) -> Mapping[str, Handler]:
        """The commands that something of the checkout does."""
        return {name: _handler(said) for name, said in self._file["command"].items()}

    @functools.cached_property
    def benches(self) -> Mapping[str, Handler]:
        """What can be measured, in the order of a whole measurement."""
        return {name: _handler(said) for name, said in self._file["bench"].items()}

    # --- what commands take -------------------------------------------------------------------------------------------

    def add_options(self, command: Command, parser: ArgumentParser) -> None:
        """Add what a command takes to a parser, as far as the table or the checkout knows it."""
        command.add_options(parser)
        handler = self.handlers.get(command.name)
        if handler is not None and handler.options:
            module, _, function = handler.options.partition(":")
            sys.path.append(str(self.root / handler.path))
            getattr(importlib.import_module(module), function)(parser)
        if command.name == "bench":
            parser.add_argument("name", nargs="?", choices=list(self.benches), help="what is measured; -h behind it lists its options")

    # --- doing them ---------------------------------------------------------------------------------------------------

    def do(self, command: Command, words: Sequence[str]) -> int:
        """Do a command in this checkout; return the exit code, or become the process that does it."""
        own = {"setup": self._set_up, "doctor": self._doctor, "test": self._test, "bench": self._bench}.get(command.name)
        try:
            if own is not None:
                return own(words)
            if command.needs is Needs.PACKAGES or (command.packages_with and command.packages_with in words):
                self.make_packages()
                self.become(2, command.module, *words)
            self.make_build()
            handler = self.handlers.get(command.same_as or command.name) or Handler(2, command.module)
            self.become(handler.world, handler.module, *([command.name] if handler.named else []), *words)
        except SetupError:
            return WRONG

    def words_of(self, name: str, *words: str) -> list[str]:
        """Return the words of a process that does a command, where everything is built."""
        handler = self.handlers[name]
        return [str(self.root / f"setup/in_ros{handler.world}"), "python3", "-m", handler.module, *words]

    def become(self, world: int, module: str, *words: str) -> NoReturn:
        """Become a module in a ROS world: the same process, so that its signals and streams are the caller's."""
        self._exec(f"setup/in_ros{world}", "python3", "-m", module, *words)

    def make_packages(self) -> None:
        """See that ROS 2's world has its Python packages; raises SetupError.

        With a robot that has its messages, too; without one it is not known yet whether ROS is to be installed.
        """
        steps = ["apt", "venv2", *(["given", "wheels"] if os.environ.get(ROBOT) else [])]
        if not self.has(steps[-1]):
            self._run("setup.sh", "--quiet", "--only", ",".join(steps))

    def make_build(self) -> None:
        """See that everything is built, of Alula and of the robot; raises SetupError."""
        self._run("setup.sh", "--quiet")
        if os.environ.get(ROBOT):
            self._run("robot.sh", "--quiet")

    def has(self, step: str) -> bool:
        """Return whether a step of the set-up was done once."""
        return (self.state / "stamps" / step).exists()

    def _run(self, script: str, *words: str) -> None:
        if subprocess.run([str(self.root / "setup" / script), *words], check=False).returncode:
            raise SetupError(script)

    def _exec(self, program: str, *words: str) -> NoReturn:
        path = str(self.root / program)
        os.execv(path, [path, *words])  # noqa: S606 - no shell is wanted

    def _set_up(self, _words: Sequence[str]) -> int:
        self._run("setup.sh")
        if os.environ.get(ROBOT):
            self._run("robot.sh")
        return 0

    def _doctor(self, words: Sequence[str]) -> int:
        """Look at the installation, or at a deployment: it builds nothing, as it is asked what is wrong."""
        given = parse("doctor", words)
        if given.deployment is None and not given.json:
            self._exec("setup/doctor.sh")
        if given.deployment is None:
            why = "--json is of a deployment; name one: alula doctor DEPLOYMENT --json"
        elif not os.environ.get(ROBOT):
            why = "a deployment is a robot's; go into its folder, or name it with --robot DIR"
        elif not self.has(BUILT):
            why = "nothing is built here yet; first: alula setup"
        else:
            self.become(self.handlers["doctor"].world, self.handlers["doctor"].module, *words)
        return _refuse("doctor", why)

    def _test(self, words: Sequence[str]) -> NoReturn:
        self.make_build()
        own = os.environ.get(ROBOT) == str(self.root)
        self._exec("tests/run" if own else "setup/test_robot", *words)

    def _bench(self, words: Sequence[str]) -> int:
        """Measure; return the exit code of the first bench that fails."""
        name, *options = words or [""]
        known = ", ".join(self.benches)
        if name in {"-h", "--help"}:
            sys.stdout.write(f"usage: alula bench [{'|'.join(self.benches)}] [its options; -h lists them]\n")
            return 0
        if name.startswith("-"):
            return _refuse("bench", f"options belong to one bench: alula bench {'|'.join(self.benches)} {' '.join(words)}")
        if name and name not in self.benches:
            return _refuse("bench", f"there is no bench '{name}'; {nearest(name, self.benches) or f'there are {known}'}")
        os.environ[ROBOT] = str(self.root)  # they measure the robot of the checkout
        self.make_build()
        if name:
            self._measure(self.benches[name], options)
        for bench in self.benches.values():
            program = [str(self.root / "setup" / f"in_ros{bench.world}"), "python3", "-m", bench.module, *self._words(bench)]
            code = subprocess.run(program, check=False).returncode
            if code:
                return code
        return 0

    def _measure(self, bench: Handler, options: Sequence[str]) -> NoReturn:
        self.become(bench.world, bench.module, *self._words(bench), *options)

    def _words(self, bench: Handler) -> list[str]:
        return [word.format(root=self.root) for word in bench.words]


def checkout() -> Checkout | None:
    """Return the checkout whose entry script was called; None for a pip installation."""
    root = os.environ.get(ROOT)
    if not root or not (Path(root) / FILE).is_file() or not Path(__file__).is_relative_to(Path(root).resolve() / "lib"):
        return None
    return Checkout(Path(root))


def _handler(said: Mapping[str, Any]) -> Handler:
    return Handler(**{**said, "words": tuple(said.get("words", ()))})


def _refuse(command: str, why: str) -> int:
    sys.stderr.write(f"alula {command}: {why}\n")
    return WRONG
