"""The Robot Language: every block in all its forms, errors with hints, and whatever else may stand in a file."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alula.cli.check import main
from alula.language import rl
from alula.language.errors import LanguageError
from alula.language.lexer import MAX_ERRORS
from alula.language.models import ModelFile, check_texts
from alula.language.notation import Notation, notation_of
from alula.language.printer import print_skillset
from alula.model.expressions import TRUE, And, Comparison, DataIs, Implies, Not, ResourceIs, SkillRuns
from alula.model.json_form import to_json
from alula.model.model import (
    Assignment,
    Data,
    Effect,
    Event,
    Hold,
    Interrupt,
    Invariant,
    Parameter,
    Precondition,
    Progress,
    Property,
    PropertyKind,
    Result,
    ResultKind,
)

UAV = next(p / "skillsets" / "uav.rl" for p in Path(__file__).resolve().parents if (p / "skillsets").is_dir())
A, B = ResourceIs("r", "A"), ResourceIs("r", "B")
TO_A, TO_B = Effect("", (Assignment("r", "A"),)), Effect("", (Assignment("r", "B"),))


def members(text):
    return rl.parse(f"skillset s {{ {text} }}", "x.rl")


def skill(text):
    return members(f"skill f {{ {text} }}").skill("f")


@pytest.mark.parametrize(
    "texts",
    [
        ("data x: T period 1 sec", "data { x: T period 1.0 }", "data x: T period = 1000 ms", "data { x: T period 1 s, }"),
        ("resource r { state {A B} initial A transition all }", "resource { r { state { A, B } initial A transition { all } } }"),
        ("resource r { state {A B} initial A transition { A -> B } }", "resource r { transition A -> B initial A state A B }"),
        ("event e { guard r == A effect r -> B }", "event { e { effect { r -> B } guard r == A } }", "event e guard r == A effect r -> B"),
        ("skill { f {} g {} }", "skill f {} skill g {}", "skill f { /* nothing\n */ } // nothing\nskill g {}"),
        ("parameter x: T", "parameter { x: T }"),
        ("property { a: never r == A }", "property a: never (r == A)", "property a: never resource = (r == A)"),
    ],
)
def test_members_in_all_their_forms(texts):
    first, *others = [to_json(members(text)) for text in texts]
    assert others == [first] * len(others)


@pytest.mark.parametrize(
    ("text", "field", "expected"),
    [
        ("input x: T", "inputs", (Parameter("x", "T"),)),
        ("input { x: T y: U }", "inputs", (Parameter("x", "T"), Parameter("y", "U"))),
        ("output { x: T // metres\n }", "outputs", (Parameter("x", "T", comment="metres"),)),
        ("parameter { x: T = 0.5 m/s }", "parameters", (Parameter("x", "T", "0.5 m/s"),)),
        ("precondition p: r == A", "preconditions", (Precondition("p", A),)),
        ("precondition r == A", "preconditions", (Precondition("precondition", A),)),
        ("precondition { r == A not r == B }", "preconditions", (Precondition("precondition", A), Precondition("precondition_2", Not(B)))),
        ("precondition { p : r==A, q: r != B and true => r == A }", "preconditions", None),
        ("precondition { p: x.level > 0.2 m: y >= 3 m }", "preconditions", None),
        ("start r -> B", "start", TO_B),
        ("start { r -> B }", "start", TO_B),
        ("start { r -> A q -> C }", "start", Effect("", (Assignment("r", "A"), Assignment("q", "C")))),
        ("invariant i { guard r == A }", "invariants", (Invariant("i", A),)),
        ("invariant { i { guard r == A effect r -> B } }", "invariants", (Invariant("i", A, TO_B),)),
        ("invariant { i: r == A effect { r -> B } }", "invariants", (Invariant("i", A, TO_B),)),
        ("invariant i: r == A effect r -> B", "invariants", (Invariant("i", A, TO_B),)),
        ("invariant i guard r == A effect r -> B", "invariants", (Invariant("i", A, TO_B),)),
        ("invariant r == A", "invariants", (Invariant("invariant", A),)),
        ("invariant { guard r == A effect r -> B }", "invariants", (Invariant("invariant", A, TO_B),)),
        ("invariant i: r == A for 2 s", "invariants", (Invariant("i", A, hold=Hold(2.0)),)),
        ("progress { period 1 sec }", "progress", Progress(1.0)),
        ("progress { period 1.0 message T }", "progress", Progress(1.0, "T")),
        ("progress { period 250 ms output x: T }", "progress", Progress(0.25, outputs=(Parameter("x", "T"),))),
        ("progress { period 1 message { x: T y: U } }", "progress", Progress(1.0, outputs=(Parameter("x", "T"), Parameter("y", "U")))),
        ("progress { deadline 1 min period 1 }", "progress", Progress(1.0, deadline_s=60.0)),
        ("progress period 1 sec message x: T output y: U", "progress", Progress(1.0, outputs=(Parameter("x", "T"),))),
        ("progress 2 s", "progress", Progress(2.0)),
        ("interrupt { interrupting true }", "interrupt", Interrupt(interrupting=True)),
        ("interrupt { }", "interrupt", Interrupt()),
        ("interrupt interrupting false effect r -> B", "interrupt", Interrupt(effect=TO_B)),
        ("interrupt { effect { r -> B } postcondition r == B interrupting true }", "interrupt", Interrupt(True, TO_B, B)),
        ("interrupt { timeout 500 ms effect r -> B }", "interrupt", Interrupt(effect=TO_B, timeout_s=0.5)),
        ("interrupt timeout 2 s effect r -> B", "interrupt", Interrupt(effect=TO_B, timeout_s=2.0)),
        ("success ok", "results", (Result("ok", ResultKind.SUCCESS),)),
        ("success { a {} b }", "results", (Result("a", ResultKind.SUCCESS), Result("b", ResultKind.SUCCESS))),
        ("failure ko { effect r -> B postcondition r == B }", "results", (Result("ko", ResultKind.FAILURE, TO_B, B),)),
        ("failure ko effect r -> B postcondition r == B", "results", (Result("ko", ResultKind.FAILURE, TO_B, B),)),
        ("success ok {postcondition r==B}", "results", (Result("ok", ResultKind.SUCCESS, postcondition=B),)),
        ("result R { } // why\n", "results", (Result("R", comment="why"),)),
        ("success ok effect e: r -> B", "effects", (Effect("e", (Assignment("r", "B"),)),)),
    ],
)
def test_blocks_in_all_their_forms(text, field, expected):
    found = getattr(skill(text), field)
    if expected is None:
        names = [precondition.name for precondition in found]
        assert names == (["p", "q"] if "q:" in text else ["p", "m"])
        last = found[1].condition
        assert last == (
            Implies(And((ResourceIs("r", "B", negated=True), TRUE)), A) if "q:" in text else DataIs("y", (), Comparison.GE, 3.0, "m")
        )
        return
    assert found == expected


def test_order_and_several_skillsets_and_shared_types():
    text = """type { Float Point } type Unused
      skillset one { skill f { success ok input x: Float } }
      skillset two { data p: Point  event e { effect r -> A }  resource r { state { A } initial A } }"""
    (file,) = check_texts([ModelFile("x.rl", text)])
    assert [(s.name, s.types) for s in file.skillsets] == [("one", ("Float",)), ("two", ("Point",))]
    assert [(d.code, d.span.line) for d in file.findings if d.code == "ALU303"] == [("ALU303", 1)]
    assert file.skillsets[1].data == (Data("p", "Point"),)
    assert file.skillsets[1].events == (Event("e", effect=TO_A),)


def test_a_file_of_types_alone():
    (file,) = check_texts([ModelFile("x.rl", "type Float\ntype Double\n")])
    assert file.findings == []
    assert file.skillsets == ()


def test_properties():
    text = "property p: f running leads to not r == A assuming termination property q: always (f running => r == B)"
    found = members(text).properties
    assert found == (
        Property("p", PropertyKind.LEADS_TO, SkillRuns("f"), Not(A), fair=True),
        Property("q", PropertyKind.ALWAYS, Implies(SkillRuns("f"), B)),
    )


def test_the_notation_is_seen_from_the_name_or_the_words():
    assert notation_of("a.rl", "skillset s {}") is Notation.ROBOT_LANGUAGE
    assert notation_of("a.skill", "event e { guard a == B }") is Notation.PAPER
    assert notation_of("a.txt", "event e { guard a == B }") is Notation.ROBOT_LANGUAGE
    assert notation_of("a.txt", "skill f { progress = 0.5 }") is Notation.PAPER


# --- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "code", "message", "hint"),
    [
        ("skill f { precondition p: r = A }", "ALU103", "found `=`", "compared with `==`"),
        ("skill f { start r => A }", "ALU103", "expected `->`", "resource -> STATE"),
        ("skill f { succes ok }", "ALU103", "found `succes`", "did you mean `success`?"),
        ("skill f { invariant i { effect r -> A } }", "ALU103", "invariant `i` has no `guard`", "guard resource == STATE"),
        ("skill f { progress { message T } }", "ALU103", "no `period`", "period 1 sec"),
        ("skill f { start r -> A start r -> B }", "ALU106", "`start` is given twice", "put the entries together"),
        ("skill f { success ok { postcondition r == A postcondition r == B } }", "ALU106", "`postcondition` is given twice", ""),
        ("event e { guard r == A guard r == B effect r -> A }", "ALU106", "`guard` is given twice", ""),
        ("skill f { start tke success ok effect take: r -> A }", "ALU204", "no effect `tke`", "did you mean `take`?"),
        ("resource r { state { A } initial A transition A }", "ALU103", "", "transition all"),
        ("property p: r == A", "ALU103", "expected `leads`", "begin with `never`"),
        ("skill f { success ok { precondition r == A } }", "ALU103", "expected `effect` or `postcondition`", ""),
    ],
)
def test_errors_of_the_notation(text, code, message, hint):
    with pytest.raises(LanguageError) as caught:
        members(text)
    finding = next(d for d in caught.value.diagnostics if d.code == code)
    assert message in finding.message
    assert hint in finding.hint


def test_all_errors_of_a_file_at_once():
    """What is wrong with the notation in one skill hides neither that of others nor what other skills mean."""
    text = """skillset s {
  resource r { state { A B } initial A transition { A -> B  extern B -> A } }
  skill f {
    precondition {
      p: r = A
      q: == B
    }
    start r => B
    success ok
  }
  skill g {
    precondition p: r == C
    start r -> A
    success ok
  }
  skil h { }
  skill i {
    start q -> B
    success ok
  }
  event e { effect r -> D }
}"""
    (file,) = check_texts([ModelFile("x.rl", text)])
    assert [(d.code, d.span.line) for d in file.findings] == [("ALU103", 5), ("ALU103", 6), ("ALU103", 8), ("ALU103", 16)]
    (file,) = check_texts([ModelFile("x.rl", text.replace("  skil h { }\n", ""))])
    assert [(d.code, d.span.line) for d in file.findings] == [
        ("ALU103", 5),
        ("ALU103", 6),
        ("ALU103", 8),
        ("ALU203", 12),
        ("ALU210", 13),
        ("ALU202", 17),
        ("ALU203", 20),
    ]


def test_data_compared_like_a_resource():
    (file,) = check_texts([ModelFile("x.rl", "skillset s { data m: string skill f { precondition p: m == AUTO success ok } }")])
    (finding,) = file.findings
    assert (finding.code, finding.span.column) == ("ALU202", 55)
    assert '`m == "AUTO"`' in finding.hint


# --- the example -----------------------------------------------------------------------------------------------------


def test_the_example_is_false_right_after_the_start(capsys):
    assert main([str(UAV), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    (finding,) = document["files"][0]["findings"]
    assert finding["code"] == "ALU510"
    assert "`goto`" in finding["message"]
    assert finding["counterexample"][0] == "authority == None"
    assert main([str(UAV), "--no-proofs"]) == 0


def test_conversion_on_the_command_line(tmp_path, capsys):
    assert main([str(UAV), "--to", "paper"]) == 0
    there = tmp_path / "uav.skill"
    there.write_text(capsys.readouterr().out)
    assert main([str(there), "--to", "rl"]) == 0
    back = rl.parse(capsys.readouterr().out)
    assert to_json(back) == to_json(rl.parse(UAV.read_text()))
    both = tmp_path / "both.rl"
    both.write_text("type T type Loose skillset a { data x: T } skillset b { data y: T }")
    assert main([str(both), "--to", "paper"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("type Loose\n\nskillset a {\n  type T\n")
    (file,) = check_texts([ModelFile("x.skill", printed)])
    assert [(s.name, s.types) for s in file.skillsets] == [("a", ("T",)), ("b", ("T",))]


def test_strict_makes_errors_of_warnings(tmp_path, capsys):
    path = tmp_path / "x.rl"
    path.write_text("type T skillset s { }")
    assert main([str(path)]) == 0
    assert main([str(path), "--strict"]) == 1
    assert "error ALU303" in capsys.readouterr().out


# --- any text --------------------------------------------------------------------------------------------------------

WHOLE = print_skillset(rl.parse(UAV.read_text()), Notation.ROBOT_LANGUAGE)
PIECES = [*"{}():=,;<>.", "==", "->", "=>", "not", "for", "leads to", "running", "guard", "effect", "skill", "/*", '"', "1e999", "é", "\0"]


def survives(text, name="x.rl"):
    (file,) = check_texts([ModelFile(name, text)])
    assert len(file.findings) <= MAX_ERRORS + 200
    for finding in file.findings:
        assert finding.span.line <= text.count("\n") + 1
        assert finding.render()


@settings(max_examples=150)
@given(st.integers(0, len(WHOLE)), st.integers(0, 60), st.sampled_from(["", *PIECES]), st.sampled_from(["x.rl", "x.skill", "x"]))
def test_a_model_with_something_cut_out_or_put_in(place, length, piece, name):
    survives(WHOLE[:place] + piece + WHOLE[place + length :], name)


@settings(max_examples=100)
@given(st.lists(st.sampled_from([*PIECES, *WHOLE.split()]), max_size=100).map(" ".join))
def test_any_row_of_words(text):
    survives("skillset s { skill f { " + text)


@pytest.mark.long
@pytest.mark.parametrize(
    "junk", ["{", "skill f {", "effect {", "not ", "(", "a -> b ", "invariant { i {", "success ", "/*", "type T ", "skillset s {} "]
)
def test_the_largest_text_takes_seconds_at_most(junk):
    text = "skillset s { skill f { " + junk * (299_000 // len(junk))
    start = time.process_time()
    survives(text)
    survives(junk * (299_000 // len(junk)))
    assert time.process_time() - start < 20.0


LARGE = {
    "states": ("resource q { state { @ } initial s0 transition all }", "s{} "),
    "arrows": ("resource q { initial A @ }", "A -> B "),
    "types": ("@", "type T{} "),
    "data of unknown types": ("@", "data d{0}: T{0} "),
    "unknown resources": ("skill f { start { @ } }", "q{} -> A "),
    "conditions without a name": ("skill f { precondition { @ } }", "(r == A) "),
    "unknown states": ("skill f { precondition { @ } }", "p{0}: r == S{0} "),
    "inputs that are outputs": ("skill f { input { @ } output { @ } }", "x{}: bool "),
    "events": ("@", "event e{} {{ effect q -> A }} "),
    "skills": ("@", "skill f{} {{}} "),
    "a long condition": ("skill f { precondition p: @ true }", "r == A and "),
}


@pytest.mark.parametrize("name", LARGE)
def test_the_largest_models_are_checked_soon(name):
    text, one = LARGE[name]
    resources = " ".join(f"resource r{i} {{ state {{ A B }} initial A transition all }}" for i in range(500))
    entries = "".join(one.format(i) for i in range(120_000 // len(one)))
    whole = f"skillset s {{ resource r {{ state {{ A B }} initial A transition all }} {resources} {text} }}".replace("@", entries)
    start = time.process_time()
    survives(whole)
    assert time.process_time() - start < 10.0


def test_a_resource_of_too_many_states():
    states = " ".join(f"s{i}" for i in range(251))
    (file,) = check_texts([ModelFile("x.rl", f"skillset s {{ resource ^r {{ state {{ {states} }} initial s0 }} }}".replace("^", ""))])
    assert [(d.code, d.span.column) for d in file.findings] == [("ALU109", 23)]


def test_ten_megabytes_and_wrong_encodings(tmp_path, capsys):
    for name, content in {"large.rl": b"skillset s { " * 800_000, "utf16.rl": WHOLE.encode("utf-16"), "latin.rl": b"// \xe9"}.items():
        (tmp_path / name).write_bytes(content)
        assert main([str(tmp_path / name), "--json"]) == 2
        (found,) = json.loads(capsys.readouterr().out)["files"]
        assert [f["code"] for f in found["findings"]] in (["ALU002"], ["ALU003"])
