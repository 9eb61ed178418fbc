"""The parser of a command's words: argparse, whose complaints are one line that names the nearest known word."""

from __future__ import annotations

import argparse
import contextlib
import math
from typing import Any, NoReturn

from alula.common.suggestions import nearest

WRONG = 2
"""Exit code of a command line that can't be."""
_WORDS = "words"
_UNKNOWN = "unrecognized arguments: "
"""How argparse begins to say that it knows no such words."""


class Parser(argparse.ArgumentParser):
    """Reads a command's words; wrong ones end the process with one line on the standard error, and exit code 2."""

    _typed: tuple[str, ...] = ()

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, and exit with code 2."""
        # Before what is missing: a word that can't be may have been meant for it.
        unknown = [word for word in self._typed if self._is_unknown(word)] or message.partition(_UNKNOWN)[2].split()
        text = self._about(unknown[0]) if unknown else message.removeprefix("argument ")
        more = "" if text.endswith("?") else f"; '{self.prog} --help' lists what it takes"
        self.exit(WRONG, f"{self.prog}: {text}{more}\n")

    def completed_by(self, words: str) -> list[argparse.Action]:
        """Return the arguments that these words of the robot complete."""
        return [action for action in self._actions if words_completing(action) == words]

    def _parse_known_args(self, arg_strings: list[str], *others: Any) -> Any:
        self._typed = tuple(arg_strings)
        return super()._parse_known_args(arg_strings, *others)

    def _known(self) -> list[str]:
        return [name for action in self._actions for name in action.option_strings if name.startswith("--")]

    def _is_unknown(self, word: str) -> bool:
        """Return whether a word looks like an option, and is the beginning of none that there is."""
        option = word.partition("=")[0]
        return len(option) > len("--") and option.startswith("--") and not any(name.startswith(option) for name in self._known())

    def _about(self, word: str) -> str:
        """Return what to say of a word that nothing takes, with the nearest option."""
        if not word.startswith("-"):
            return f"there is no argument {word}"
        option = word.partition("=")[0]
        hint = nearest(option, self._known())
        return f"there is no option {option}{f'; {hint}' if hint else ''}"

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            if isinstance(action.choices, range):
                raise argparse.ArgumentError(action, f"{value} does not lie between {action.choices[0]} and {action.choices[-1]}")
            known = [str(one) for one in action.choices]
            hint = nearest(str(value), known) or f"there is {', '.join(known)}"
            raise argparse.ArgumentError(action, f"there is no {value}; {hint}")


def json_option(parser: argparse.ArgumentParser, what: str) -> None:
    """Add ``--json``: a command prints ``what`` then as `alula.common.files.json_line` does, a line each."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as JSON, an object a line")


def within_option(parser: argparse.ArgumentParser, what: str) -> None:
    """Add ``--within SECONDS``."""
    parser.add_argument("--within", type=_seconds, metavar="SECONDS", help=what)


def time_option(parser: argparse.ArgumentParser, default_s: float, what: str) -> None:
    """Add ``--time SECONDS``; ``what`` it limits, as the help says it."""
    words = f"time limit{what} (default {default_s:g})"
    parser.add_argument("--time", type=_seconds, default=default_s, metavar="SECONDS", help=words)


def _seconds(text: str) -> float:
    with contextlib.suppress(ValueError):
        if 0.0 <= (seconds := float(text)) < math.inf:  # also refuses nan
            return seconds
    raise argparse.ArgumentTypeError(f"{text} is no number of seconds; write one from 0 on")


def completed_by(action: argparse.Action, words: str) -> None:
    """Say which words of the robot complete an argument: a name of `alula.cli.completion.WORDS`."""
    setattr(action, _WORDS, words)


def words_completing(action: argparse.Action) -> str:
    """Return what `completed_by` has said; empty: nothing."""
    return str(getattr(action, _WORDS, ""))
