"""The table of commands: what is said of each, and that what it names is there."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.cli.__main__ import WordsError, main, split_robot
from alula.cli.completion import WORDS
from alula.cli.options.models import NOTATIONS
from alula.cli.parser import words_completing
from alula.cli.table import COMMANDS
from alula.language.notation import Notation


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_is_described_and_its_module_does_it(name: str) -> None:
    command = COMMANDS[name]
    assert command.about[0].islower()
    assert not command.about.endswith(".")
    assert command.name == name
    assert not command.module or callable(importlib.import_module(command.module).main)
    assert all(action.help for action in command.parser()._actions)
    assert {words_completing(action) for action in command.parser()._actions} <= {"", *WORDS}


def test_json_is_the_same_in_every_command_that_has_it() -> None:
    helps = {
        name: str(action.help) for name in COMMANDS for action in COMMANDS[name].parser()._actions if "--json" in action.option_strings
    }
    assert {"check", "conform", "data", "doctor", "odds", "replay", "status", "tree"} <= set(helps)
    assert {name for name, text in helps.items() if not text.endswith(" as JSON, an object a line")} == set()


def test_what_the_table_names_without_importing_it_is_there() -> None:
    assert set(NOTATIONS) == {notation.value for notation in Notation}


def test_the_front_imports_nothing_of_any_command() -> None:
    told = "import sys, alula.cli.__main__; print(*(name for name in sys.modules if name.startswith('alula.')))"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert all(name.startswith(("alula.cli", "alula.common")) for name in done.stdout.split()), done.stdout


WORD = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), min_size=1).filter(lambda word: word.partition("=")[0] != "--robot")


@given(before=st.lists(WORD), after=st.lists(WORD), folder=WORD, joined=st.booleans())
def test_the_robot_is_taken_out_wherever_it_stands(before: list[str], after: list[str], folder: str, *, joined: bool) -> None:
    named = [f"--robot={folder}"] if joined else ["--robot", folder]
    assert split_robot([*before, *named, *after]) == ([*before, *after], folder)
    assert split_robot([*before, *after]) == ([*before, *after], None)


@pytest.mark.parametrize("words", [["check", "--robot"], ["--robot=", "check"]])
def test_a_robot_without_a_folder_is_refused(words: list[str]) -> None:
    with pytest.raises(WordsError, match="--robot needs a folder"):
        split_robot(words)


@pytest.fixture
def _of_pip(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ALULA_ROOT", raising=False)


@pytest.mark.usefixtures("_of_pip")
@pytest.mark.parametrize("name", [name for name, command in COMMANDS.items() if not command.anywhere])
def test_what_pip_does_not_bring_says_where_it_is(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    needed = {"start": ["x"], "interrupt": ["x"], "why": ["x"], "transition": ["x", "y"], "up": ["x"], "service": ["install", "x"]}
    words = needed.get(name, [])
    assert main([name, *words]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert said.err.startswith(f"alula: {name}: ")
    assert "use its entry script ./alula" in said.err


@pytest.mark.usefixtures("_of_pip")
def test_pips_help_lists_what_it_has_and_names_the_rest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["help"]) == 0
    told = capsys.readouterr().out
    assert "\n  check " in told
    assert "\n  panel " not in told
    besides = told.partition("besides: ")[2].partition(".")[0].split(", ")
    assert besides == [name for name, command in COMMANDS.items() if not command.anywhere]
