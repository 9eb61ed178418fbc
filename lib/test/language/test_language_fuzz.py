"""Whatever stands in a file: a model or a LanguageError, soon."""

from __future__ import annotations

import time
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_language_listings import LISTING_2, LISTING_3

from alula.cli.check import main
from alula.language import rl
from alula.language.check import check
from alula.language.errors import LanguageError
from alula.language.lexer import MAX_CHARACTERS, MAX_ERRORS
from alula.language.load import load_skillset
from alula.language.paper import parse

WHOLE = f"skillset navigation {{ type Point data p: Point period = 1 {LISTING_2} {LISTING_3} }}"
ROBOT_LANGUAGE = """
type Point
skillset s {
  data d: float64 period 100 ms
  resource r { state { A B } initial A transition { A -> B  extern B -> A } }
  event e { guard r == B effect r -> A }
  skill f {
    input x: Point
    precondition p: r == A and not d < 3 %
    start r -> B
    invariant { i { guard d >= 10 for 2 s recovers at 12 effect { r -> B r -> B } } }
    progress { period 1 sec deadline 5 s message y: float64 }
    interrupt { interrupting false effect r -> B postcondition r == B => true }
    success ok { effect r -> B } // done
    failure { KO {} }
  }
  property q: f running leads to r == A assuming termination
}
"""
PIECES = [*"{}():=", "==", "->", "=>", "not", "and", "skill", "resource", "data", "initial", '"', "//", "0.5", "1e999", "é", "\0", "\n"]
PIECES += ["/*", "*/"]


def read(text: str, notation=parse) -> None:
    """Read and check; findings must be sound: places inside of the text, text to show, at least one where it is refused."""
    try:
        findings = check(notation(text, "x"))
    except LanguageError as error:
        findings = error.diagnostics
        assert 0 < len(findings) <= MAX_ERRORS + 1
    lines = text.split("\n")
    for finding in findings:
        span = finding.span
        assert 1 <= span.line <= len(lines)
        assert 1 <= span.column < span.end_column <= len(lines[span.line - 1]) + 2  # the end of a line counts as a character
        assert finding.message
        assert finding.render()


@settings(max_examples=200)
@given(st.text(max_size=200))
def test_any_text(text):
    read(text)


@settings(max_examples=150)
@given(st.lists(st.sampled_from([*PIECES, *WHOLE.split()]), max_size=120).map(" ".join))
def test_any_row_of_words(text):
    read("skillset s { " + text)


@settings(max_examples=200)
@given(st.integers(0, len(WHOLE)), st.integers(0, 30), st.sampled_from(["", *PIECES]))
def test_a_model_with_something_cut_out_or_put_in(place, length, piece):
    read(WHOLE[:place] + piece + WHOLE[place + length :])


@settings(max_examples=200)
@given(st.lists(st.tuples(st.integers(0, len(ROBOT_LANGUAGE)), st.integers(0, 30), st.sampled_from(["", *PIECES])), max_size=3))
def test_a_model_of_the_robot_language_with_something_cut_out_or_put_in(changes):
    text = ROBOT_LANGUAGE
    for place, length, piece in changes:
        text = text[:place] + piece + text[place + length :]
    read(text, rl.parse)


@pytest.mark.parametrize("text", ["skillset s {\n  resource hatch/* {\n" + "    state { A B }\n" * 40, "skillset s { /*", "/*\n\n"])
def test_a_comment_without_an_end_leaves_the_end_of_the_file_where_it_is(text):
    read(text)
    read(text, rl.parse)


@settings(max_examples=150)
@given(st.data())
def test_the_whole_check_of_a_mutated_model_of_the_robot_language(data):
    """Many single characters changed, put in or left out, then all that `./alula check` does: an exit code, and text or JSON."""
    text = list(ROBOT_LANGUAGE)
    for _ in range(data.draw(st.integers(0, 12))):
        place = data.draw(st.integers(0, len(text)))
        text[place : place + data.draw(st.integers(0, 2))] = data.draw(st.sampled_from(["", *PIECES, *"abAZ09_.>< \t"]))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.rl"
        path.write_text("".join(text), encoding=data.draw(st.sampled_from(["utf-8", "utf-8", "latin-1", "utf-16"])))
        with redirect_stdout(StringIO()) as told:
            code = main([str(path), "--time", "5", *data.draw(st.sampled_from([[], ["--json"]]))])
        assert code in {0, 1, 2}
        assert told.getvalue().strip()


def test_what_is_cut_is_found():
    """Each single token of the listings is needed, except the `=` of a period, which the Robot Language has not."""
    unharmed = []
    tokens = WHOLE.split(" ")
    for index, token in enumerate(tokens):
        if token.strip() in {"{", "}", "->", ":", "="} and tokens[index - 1] != "period":
            text = " ".join(tokens[:index] + tokens[index + 1 :])
            try:
                parse(text)
            except LanguageError:
                continue
            unharmed.append((index, token))
    assert unharmed == []


@pytest.mark.parametrize(
    ("opening", "code"), [("(", "ALU105"), ("not ", "ALU105"), ("a == B => ", "ALU105"), ("not (", "ALU105"), ("resource = (", "ALU103")]
)
def test_deep_nesting_is_an_error(opening, code):
    with pytest.raises(LanguageError) as caught:
        parse("skillset s { skill f { precondition { p: resource = (" + opening * (250_000 // len(opening)))
    assert [finding.code for finding in caught.value.diagnostics] == ["ALU104", code]


def test_a_text_that_is_too_large_is_one_finding():
    with pytest.raises(LanguageError) as caught:
        parse("skillset s { }" + " " * MAX_CHARACTERS)
    assert [finding.code for finding in caught.value.diagnostics] == ["ALU003"]


def test_deep_blocks_are_an_error():
    with pytest.raises(LanguageError):
        parse("skillset s { skill f { effect { a " + "{ " * 100_000)


def test_many_operands_are_none():
    text = "skillset s { skill f { precondition { p: resource = (" + " and ".join(["a == B"] * 20_000) + ") } } }"
    assert len(parse(text).skill("f").preconditions[0].condition.operands) == 20_000


@pytest.mark.parametrize("junk", ["\x00\xff\x01", "a ", "$ ", "{(", '"', "skillset s {", "// x\n"])
def test_five_megabytes_of_junk_take_no_time(tmp_path, junk):
    path = tmp_path / "junk.skill"
    path.write_bytes((junk * (5_000_000 // len(junk))).encode("latin-1"))
    start = time.process_time()
    with pytest.raises(LanguageError) as caught:
        load_skillset(path)
    assert time.process_time() - start < 1.0
    assert len(caught.value.diagnostics) == 1
    assert caught.value.diagnostics[0].code == "ALU003"


@pytest.mark.parametrize("junk", ["\x00\x01", "a ", "$ ", "{(", '"\n', "skillset s {", "}"])
def test_the_largest_text_that_is_read_takes_seconds_at_most(junk):
    text = "skillset s {" + junk * (299_000 // len(junk))
    start = time.process_time()
    with pytest.raises(LanguageError) as caught:
        parse(text)
    assert time.process_time() - start < 10.0
    assert len(caught.value.diagnostics) <= MAX_ERRORS + 1
