"""What a robot's part adds to its live runs, as data: for those who can't import the part, and ask ``alula run --options``."""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import re
import signal
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from alula.common.operator import FAULTS
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RequestError

FLAG = "--options"
TIMEOUT_S = 120.0  # wall clock; it may have to set up what has changed
_VALUE = re.compile(r"[^\x00-\x1f\x7f]{1,300}")


@dataclass(frozen=True)
class RunOption:
    """An option without its dashes. ``default``: what holds where it is left out; ``choices``: empty where any text may stand."""

    name: str
    about: str
    metavar: str = ""
    default: str = ""
    choices: tuple[str, ...] = ()
    takes_value: bool = True

    def word(self, value: str) -> str:
        """Return it for a command line; raises RequestError for a value that it can't have."""
        if self.takes_value and not _VALUE.fullmatch(value):
            raise RequestError(f"--{self.name}: needs a text of one line, at most 300 characters")
        if self.choices and value not in self.choices:
            raise RequestError(f"--{self.name}: there is no {value!r}; there are {', '.join(self.choices)}")
        return f"--{self.name}={value}" if self.takes_value else f"--{self.name}"


@dataclass(frozen=True)
class RunOffer:
    """A robot's own options in their order, and what can fail in every scenario, each with the ways in which it can."""

    options: tuple[RunOption, ...] = ()
    faults: Mapping[str, Sequence[str]] = field(default_factory=dict)


def offer_of(part: RunPart) -> RunOffer:
    """Return what a part declares, and the operator of every robot."""
    parser = argparse.ArgumentParser(add_help=False)
    part.add_options(parser)
    actions = parser._actions  # noqa: SLF001  (argparse offers no other way to look at what was declared)
    return RunOffer(tuple(map(_option, actions)), {what: tuple(ways) for what, ways in {**part.faults, **FAULTS}.items()})


def _option(action: argparse.Action) -> RunOption:
    return RunOption(
        name=next(word for word in action.option_strings if word.startswith("--"))[2:],
        about=action.help or "",
        metavar=action.metavar if isinstance(action.metavar, str) else "",
        default="" if action.default is None or action.nargs == 0 else str(action.default),
        choices=tuple(map(str, action.choices or ())),
        takes_value=action.nargs != 0,
    )


def as_json(part: RunPart) -> str:
    """Return what `read_offer` reads."""
    return json.dumps(asdict(offer_of(part)))


def read_offer(text: str) -> RunOffer:
    """Read what `as_json` wrote; raises ValueError, TypeError, KeyError."""
    said = json.loads(text)
    options = tuple(RunOption(**{**one, "choices": tuple(one["choices"])}) for one in said["options"])
    return RunOffer(options, {what: tuple(ways) for what, ways in said["faults"].items()})


async def ask_offer() -> RunOffer:
    """Ask the robot's ``alula run``; raises RequestError, with its words, where the robot can't be run live here.

    Who is cancelled while it waits leaves no process behind.
    """
    try:
        # Started at once rather than by asyncio: who is cancelled while asyncio starts a process doesn't get to know its group.
        with subprocess.Popen(  # noqa: ASYNC220
            [entry(), "run", FLAG],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as asked:
            try:
                told, why = await asyncio.to_thread(asked.communicate, timeout=TIMEOUT_S)
            finally:
                if asked.poll() is None:
                    os.killpg(asked.pid, signal.SIGTERM)
        if asked.returncode:
            raise RequestError((why.strip().splitlines() or [f"alula run {FLAG} ended with {asked.returncode}"])[-1])
        return read_offer(told)
    except (OSError, subprocess.TimeoutExpired, ValueError, TypeError, KeyError) as error:
        raise RequestError(f"alula run {FLAG}: {error}") from None


def entry() -> str:
    """Return the entry script, of the checkout that this process belongs to."""
    return str(Path(os.environ["ALULA_ROOT"]) / "alula")


def words_of(given: Mapping[str, str], known: Sequence[RunOption]) -> list[str]:
    """Return options for a command line; raises RequestError where the robot declares no such option, or the value can't be."""
    options = {option.name: option for option in known}
    for name in given:
        if name not in options:
            said = f"it declares --{', --'.join(options)}" if options else "it declares none"
            raise RequestError(f"the robot has no option --{name}; {said}")
    return [options[name].word(value) for name, value in given.items()]
