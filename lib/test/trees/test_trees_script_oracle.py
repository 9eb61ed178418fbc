"""Scripts run as BehaviorTree.CPP itself runs them (behaviortreepy: BT.CPP 4.8.2): equal values, types and errors.

Where 4.8 and 4.9 differ, 4.9 is followed and the place is noted (docs/reference/scripts.md): such scripts are held against a list.
"""

from __future__ import annotations

import random

import pytest
from trees_script_printer import print_program
from trees_scripts import NUMBERS, Oracle, ours, random_script, random_words

from alula.trees.script import ScriptError, parse

SCRIPTS = 4000
SOUPS = 6000


@pytest.fixture(scope="module")
def oracle():
    return Oracle()


def notes(script):
    return [note.message for note in parse(script).notes]


def test_random_scripts_run_alike(oracle):
    chance = random.Random(21)  # noqa: S311
    ends = {"ok": 0, "run": 0}
    for _ in range(SCRIPTS):
        script = random_script(chance)
        if notes(script):
            script = script.replace("+4", "4").replace('"', "'")
        expected = oracle.run(script)
        assert (script, *ours(script)) == (script, *expected)
        ends[expected[0]] += 1
    assert min(ends.values()) > SCRIPTS / 10


def test_random_words_are_refused_alike(oracle):
    """Without brackets: what binds how tightly, what may be mixed. What is noted may differ, and nothing else."""
    chance = random.Random(4)  # noqa: S311
    same = {"ok": 0, "run": 0, "parse": 0}
    for _ in range(SOUPS):
        script = random_words(chance)
        end, entries = ours(script)
        expected = oracle.run(script)
        if end != "parse" and (notes(script) or parse(script).names.called):
            continue
        assert (script, end, entries) == (script, *expected)
        same[end] += 1
    assert min(same.values()) > SOUPS / 100


def test_what_is_printed_means_the_same_to_all(oracle):
    """The printer's brackets take every difference between 4.8 and 4.9 away."""
    chance = random.Random(9)  # noqa: S311
    printed = 0
    for _ in range(SOUPS):
        script = random_words(chance)
        try:
            program = parse(script)
        except ScriptError:
            continue
        text = print_program(program)
        if program.names.called or any("names" in note or "double quotes" in note for note in notes(text)):
            continue
        assert notes(text) == []
        assert ours(text) == ours(script), script
        assert (text, *ours(text)) == (text, *oracle.run(text))
        printed += 1
    assert printed > SOUPS / 50


DIFFERENT = (
    ("a := 10 - 5 - 2", "10 - (5 - 2)", "a := (10 - 5) - 2", "`a - b - c`"),
    ("a := 8 / 4 * 2", "8 / (4 * 2)", "a := (8 / 4) * 2", "`a / b * c`"),
    ("a := 1 || 0 && 0", "(1 || 0) && 0", "a := 1 || (0 && 0)", "`a || b && c`"),
    ("a := !0 && 1 + 1 == 2", "", "a := !0 && (1 + 1) == 2", "beside logic of bits"),
    ("a := 1 + 1 .. 'x'", "", "a := (1 + 1) .. 'x'", "joining texts"),
    ("a := 1;", "", "a := 1", "`;` at the end"),
    ("a := 'ä'", "", None, "ASCII"),
    ("a := 1..'x'", "", "a := 1 .. 'x'", "right behind a number"),
    ("trueish := 1", "", None, "begin with `true`"),
)


@pytest.mark.parametrize(("script", "before", "cured", "note"), DIFFERENT)
def test_4_8_and_4_9_differ_here(oracle, script, before, cured, note):
    """Each has a note; what 4.8 makes of it is what the note says, or a refusal; the cure means the same to both."""
    (message,) = notes(script)
    assert note in message
    assert oracle.run(script) == (oracle.run(f"a := {before}") if before else ("parse", {}))
    assert oracle.run(script) != ours(script)
    if cured:
        assert notes(cured) == []
        assert oracle.run(cured) == ours(cured) == ours(script)


@pytest.mark.parametrize("script", ["a := +4", 'a := "x"', "é := 1", "a := 1 \\\n + 1"])
def test_4_9_refuses_what_4_8_reads(oracle, script):
    (message,) = notes(script)
    assert "since 4.9" in message
    assert ours(script) == oracle.run(script)


@pytest.mark.parametrize(
    "number", [*NUMBERS, "9223372036854775807", "9223372036854775808", "0x7FFFFFFFFFFFFFFF", "0x8000000000000000", "1e308"]
)
def test_numbers_are_read_alike(oracle, number):
    assert ours(f"a := {number}") == oracle.run(f"a := {number}")


@pytest.mark.parametrize("number", ["1e309", "1e-320", "1e-400"])
def test_numbers_out_of_range_are_refused_alike(oracle, number):
    assert ours(f"a := {number}") == oracle.run(f"a := {number}") == ("parse", {})
