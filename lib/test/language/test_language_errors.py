"""Every finding about a model: its code, its place, its words and its hint."""

from __future__ import annotations

import pytest

from alula.language.check import check
from alula.language.codes import CODES, MISSION_CODES, PROOF_CODES, RUN_CODES
from alula.language.errors import LanguageError, Severity
from alula.language.load import check_file, load_robot
from alula.language.paper import parse

EYE = "initial UNKNOWN extern UNKNOWN -> OPEN extern UNKNOWN -> SHUT extern OPEN -> SHUT extern SHUT -> OPEN"
AXES = "resource axes { initial FREE FREE -> USED USED -> FREE }\n"


LINK = "resource link { initial DOWN extern DOWN -> UP extern UP -> DOWN }\n"


TAKE = "effect { take: axes -> USED give: axes -> FREE }"


END = "result { DONE: apply = give }"


def uses(effect: str) -> str:
    return f"skill f {{ effect {{ {effect} }} precondition {{ success e }} result {{ R }} }}"


def asks(block: str) -> str:
    return f"skill f {{ {block} result {{ R }} }}"


# code, a marker `^` stands before the place, what the message says, what the hint says
SYNTAX = [
    ("ALU100", "skillset s { ^$& }", "`$&` means nothing here", ""),
    ("ALU100", "skillset s { skill ^é {} }", "`é` means nothing", "names are made of"),
    ("ALU100", "skillset s { ^\x00 }", "`U+0000`", ""),
    ("ALU101", 'skillset s { skill f { precondition { p: data = (m == ^"abc) } } }', "no closing", ""),
    ("ALU102", "skillset s { skill f { progress = ^1e999 } }", "too large", ""),
    ("ALU103", "^skilset s {}", "expected `skillset` or `type`, found `skilset`", "a file holds"),
    ("ALU103", "^", "expected `skillset` or `type`, found the end of the file", "a file holds"),
    ("ALU103", "skillset s { ^skil f {} }", "found `skil`", "did you mean `skill`?"),
    ("ALU103", "skillset s { skill f { ^inputs { } } }", "found `inputs`", "did you mean `input`?"),
    ("ALU103", "skillset s { skill f { input { height ^float64 } } }", "expected `:`, found `float64`", "`name: Type`"),
    ("ALU103", "skillset s { skill f { effect { take ^axes -> USED } } }", "found `axes`", "take: resource -> STATE"),
    ("ALU103", "skillset s { skill f { precondition { p: ^axes == USED } } }", "found `axes`", "resource = (...)"),
    ("ALU103", "skillset s { skill f { precondition { p: resource = (axes ^= USED) } } }", "found `=`", "compared with `==`"),
    ("ALU103", "skillset s { skill f { precondition { p: resource = (axes == USED^} } }", "found `}`", ""),
    ("ALU103", "skillset s { skill f { progress ^0.5 } }", "expected `=`", "progress = 0.5"),
    ("ALU103", "skillset s { skill f { progress = ^fast } }", "expected a number, found `fast`", ""),
    ("ALU103", "skillset s { skill ^and { } }", "found `and`", "a word of the language"),
    ("ALU103", "skillset s { resource r { A ^B } }", "expected `->`", "`A -> B` or `extern A -> B`"),
    ("ALU103", "skillset s {} ^data t {}", "expected `skillset` or `type`, found `data`", "one or several"),
    ("ALU406", "skillset s {} skillset ^t {}", "expected one skillset, found 2", ""),
    ("ALU108", "skillset s { ^/* }", "no `*/`", ""),
    ("ALU103", "skillset s { skill f { interrupt { ^apply: give } } }", "found `apply`", ""),
    ("ALU103", "skillset s { skill f { interrupt { ^post -> give } } }", "found `post`", ""),
    ("ALU104", "skillset s { skill f ^{ progress = 1 ", "no `}` before the file ends", ""),
    ("ALU104", "skillset s { skill f { input { a: T ^effect { } } }", "opened in line 1 has no `}` before `effect`", "close the block"),
    ("ALU104", "skillset s { skill f { progress = 1 ^skill g { } }", "before `skill` begins", "close the block"),
    ("ALU105", "skillset s { skill f { precondition { p: resource = (" + "(" * 40 + "^(" + "(" * 9, "nested more than 40", ""),
    ("ALU106", "skillset s { skill f { input { } ^input { } } }", "`input` is given twice", "one of each"),
    ("ALU106", "skillset s { skill f { effect { e {} } precondition { success e ^success e } } }", "`success` is given twice", ""),
    ("ALU106", "skillset s { skill f { effect { e {} } interrupt { apply = e ^apply = e } } }", "`apply` is given twice", ""),
    ("ALU106", "skillset s { resource r { initial A ^initial B } }", "`initial` is given twice", ""),
    ("ALU106", "skillset s { resource r { state { A } ^state { B } } }", "`state` is given twice", ""),
    ("ALU204", "skillset s { skill f { effect { take {} } precondition { success ^tale } } }", "no effect `tale`", "`take`?"),
    ("ALU204", "skillset s { skill f { result { R: apply = ^give } } }", "skill `f` has no effect `give`", "`effect` block"),
]


SEMANTICS = [
    ("ALU201", AXES + "^resource axes { initial A A -> B B -> A }", "resource `axes` is defined twice", "line 2 first"),
    ("ALU201", "data a: string data ^a: string", "data `a` is defined twice", ""),
    ("ALU201", "skill f { result { R } } skill ^f { result { R } }", "skill `f` is defined twice", ""),
    ("ALU201", "type P type P data p: P", "type `P` is declared twice", ""),
    ("ALU201", "skill f { input { a: bool ^a: bool } result { R } }", "input `a` is defined twice", ""),
    ("ALU201", "type P data q: P resource ^P { initial A A -> B B -> A }", "`P` is the name of a type", "otherwise"),
    ("ALU201", "type P skill f { input { ^P: P } result { R } }", "`P` is the name of a type", "otherwise"),
    ("ALU201", "skill f { result { R ^R } }", "result `R` is defined twice", ""),
    ("ALU201", uses("e {} ^e {}"), "effect `e` is defined twice", ""),
    ("ALU201", "resource r { initial A A -> B ^A -> B B -> A }", "transition `A -> B` of `r` is given twice", ""),
    ("ALU201", "resource ^r { state { A B A } initial A A -> B B -> A }", "state `A` of `r` is listed twice", ""),
    (
        "ALU202",
        AXES + asks("precondition { p: resource = (^axis == USED) }"),
        "no resource `axis`",
        "did you mean `axes`?",
    ),
    (
        "ALU202",
        AXES + uses("e: ^nothing -> USED"),
        "no resource `nothing`",
        "there is `axes`",
    ),
    (
        "ALU203",
        AXES + asks("invariant { i: resource = (axes == ^USD) }"),
        "`axes` has no state `USD`",
        "did you mean `USED`?",
    ),
    (
        "ALU203",
        AXES + uses("e: axes -> ^used"),
        "no state `used`",
        "did you mean `USED`?",
    ),
    ("ALU203", "resource r { state { A B } initial A A -> B B -> ^C }", "no state `C`", ""),
    ("ALU205", "skill f { input { ^p: Pont } result { R } } type Point data d: Point", "unknown type `Pont`", "did you mean `Point`?"),
    ("ALU205", "data ^d: Quark", "unknown type `Quark`", "declare it with `type Quark`"),
    ("ALU206", "data level: float64 skill f { precondition { p: data = (^levle > 1) } result { R } }", "no data `levle`", "`level`?"),
    ("ALU207", "resource ^r { A -> B B -> A }", "no initial state", "add `initial A`"),
    ("ALU208", "resource ^r { initial AVAILABEL AVAILABLE -> USED USED -> AVAILABLE }", "`AVAILABEL`", "did you mean `AVAILABLE`?"),
    (
        "ALU209",
        "resource r { state { A B C } initial A A -> B B -> A } " + uses("e: ^r -> C"),
        "no transition leads",
        "to `B`",
    ),
    (
        "ALU210",
        LINK + uses("e: ^link -> UP"),
        "only the functional layer may",
        "without `extern`",
    ),
    ("ALU211", "skill f { ^progress = 0 result { R } }", "period of `f` is 0 s; it must be positive", ""),
    ("ALU211", "skill f { ^progress = -0.5 result { R } }", "is -0.5 s", ""),
    ("ALU211", "data ^d: bool period = 0", "period of data `d` is 0 s", ""),
    (
        "ALU212",
        AXES + uses("e { axes -> USED ^axes -> FREE }"),
        "sets `axes` twice",
        "one change follows the other",
    ),
    ("ALU213", "data d: float64 skill f { result { R: post data = (^d > 1) } }", "only preconditions and invariants may", "state of"),
    ("ALU213", "data d: float64 property p: never ^d > 1", "only preconditions and invariants may", ""),
    ("ALU220", "skill f { ^progress = 1 deadline = 1 result { R } }", "deadline of `f` is 1 s, its period 1 s", ""),
    ("ALU221", "data d: float64 " + asks("invariant { i: data = (d > 1) ^for 0 s }"), "it must be positive", ""),
    ("ALU221", asks("interrupt { ^timeout = 0 }"), "it must be positive", ""),
    ("ALU221", AXES + asks("invariant { i: resource = (axes == USED) ^recovers at 3 }"), "no single comparison", "fps >= 10"),
    ("ALU221", "data d: float64 " + asks("invariant { i: data = (d > 9) ^recovers at 8 }"), "not above its threshold", ""),
    ("ALU221", "data d: float64 " + asks("invariant { i: data = (d < 9 m) ^recovers at 0.1 km }"), "not below its threshold", ""),
    ("ALU219", "data d: float64 " + asks("invariant { i: data = (d < 9 m) recovers at (1 ^ft) }"), "unknown unit `ft`", ""),
    ("ALU226", f"resource ^eye {{ silence = 0.5 {EYE} }}", "the silence of `eye` is 0.5 s", "take 1 s or more"),
    ("ALU226", "resource ^r { initial A silence 2 s A -> B }", "nobody reports it", "extern A -> STATE"),
    ("ALU226", f"resource ^eye {{ silence 2 s {EYE} extern OPEN -> HURT }}", "`HURT` could not be reported", "`extern UNKNOWN -> HURT`"),
    (
        "ALU306",
        f"resource eye {{ silence 2 s {EYE} }} " + asks("precondition { ^p: resource = (eye != SHUT) }"),
        "precondition `p` holds",
        "",
    ),
    (
        "ALU306",
        f"resource eye {{ silence 2 s {EYE} }} " + asks("invariant { ^i: resource = (not eye == SHUT and eye != OPEN) }"),
        "holds while the reporter of `eye` is silent and `eye` is `UNKNOWN`",
        "`eye == UNKNOWN` or `!= UNKNOWN`",
    ),
    (
        "ALU227",
        AXES + "skill f { achieves resource = (^axes == USED) result { failure R } }",
        "with its success, and has none",
        "`provides name`",
    ),
    ("ALU228", AXES + "skill f { achieves resource = (^axes == USED) result { R: apply = { axes -> FREE } } }", "effect of `R` undoes", ""),
    ("ALU202", AXES + "skill f { achieves resource = (^axis == USED) result { R } }", "no resource `axis`", "`axes`?"),
    ("ALU201", "skill f { provides { a ^a } result { R } }", "role `a` is defined twice", ""),
    ("ALU222", "property p: never ^takeof running " + asks("").replace("skill f", "skill takeoff"), "no skill `takeof`", "`takeoff`?"),
    ("ALU214", "data d: bool skill f { precondition { p: data = (^d > true) } result { R } }", "doesn't compare a truth value", ""),
    ("ALU214", 'data d: string skill f { precondition { p: data = (^d < "a") } result { R } }', "doesn't compare a text", ""),
    ("ALU214", "data d: float64 " + asks("precondition { p: data = (^d == true) }"), "can't be compared with True", ""),
    ("ALU214", "data d: float64 " + asks("precondition { p: data = (^d.x > 1) }"), "has no field `x`", ""),
    ("ALU215", "skill f { output { ^outcome: string } result { R } }", "needs the name `outcome`", ""),
    ("ALU215", "skill f { output { ^execution: string } result { R } }", "needs the name `execution`", ""),
    ("ALU215", "skill f { input { ^skill: string } result { R } }", "needs the name `skill`", ""),
    ("ALU216", "skill f { input { ^Height: float64 } result { R } }", "`Height` can't be the name of a ROS field", "a-z"),
    ("ALU216", "skill f { input { ^class: float64 } result { R } }", "`class` can't be", "no keyword of Python"),
    ("ALU216", "skill f { input { ^a__b: float64 } result { R } }", "`a__b` can't be", ""),
    ("ALU216", "skill ^_f { result { R } }", "can't be the name of a ROS action", "begins with a letter"),
    ("ALU216", "skill ^none { result { R } }", "can't be the name of a ROS action", "is not None"),
    ("ALU216", "data ^Level: float64", "can't be the name of a ROS data", ""),
    ("ALU217", "skill go_to { result { R } } skill ^goTo { result { R } }", "`go_to` and `goTo` are both `GoTo`", ""),
    ("ALU218", "skill ^f { progress = 1 }", "skill `f` has no result", "result"),
    ("ALU219", "data d: float64 " + asks("precondition { p: data = (d > 3 ^furlong/min) }"), "unknown unit `furlong/min`", "`m/s`"),
    ("ALU301", AXES + "skill f { effect { ^e: axes -> USED } result { R } }", "effect `e` of `f` is never used", ""),
    ("ALU302", "resource ^r { initial A A -> B C -> A }", "state `C` of `r` can't be reached from `A`", ""),
    ("ALU303", "type P", "type `P` is never used", ""),
    ("ALU304", AXES + "skill f { input { ^axes: bool } result { R } }", "has the name of a resource", "never of inputs"),
]


def unmarked(text: str) -> tuple[str, tuple[int, int] | None]:
    """Return a text without its mark, and the line and column of it."""
    before, mark, after = text.partition("^")
    place = (before.count("\n") + 1, len(before) - before.rfind("\n")) if mark else None
    return before + after, place


@pytest.mark.parametrize(("code", "marked", "message", "hint"), SYNTAX)
def test_syntax(code, marked, message, hint):
    text, place = unmarked(marked)
    with pytest.raises(LanguageError) as caught:
        parse(text, "x.skill")
    finding = next(d for d in caught.value.diagnostics if d.code == code)
    assert (finding.span.line, finding.span.column) == place
    assert message in finding.message
    assert hint in finding.hint
    assert finding.severity is Severity.ERROR


@pytest.mark.parametrize(("code", "marked", "message", "hint"), SEMANTICS)
def test_semantics(code, marked, message, hint):
    text, place = unmarked(f"skillset s {{\n{marked}\n}}")
    findings = check(parse(text, "x.skill"))
    finding = next(d for d in findings if d.code == code)
    if place is not None:
        line = text.split("\n")[place[0] - 1]
        # Elements are pointed at by their name, which follows the word that the mark may stand before.
        word = line[place[1] - 1 :].split()[0]
        column = place[1] + len(word) + 1 if word in {"resource", "skill"} and ":" not in line[place[1] :][:8] else place[1]
        assert (finding.span.line, finding.span.column) == (place[0], column)
    assert message in finding.message
    assert hint in finding.hint
    assert finding.for_generator == (code in {"ALU215", "ALU216", "ALU217", "ALU218"})
    warns = code.startswith("ALU3") or code == "ALU212" or finding.for_generator
    assert finding.severity is (Severity.WARNING if warns else Severity.ERROR)


def test_an_effect_that_only_ever_stays_in_the_initial_state_is_a_warning():
    findings = check(parse("skillset s { resource r { initial A A -> B } " + uses("e: r -> A") + " }", "x.skill"))
    assert [(f.code, f.severity) for f in findings if f.code == "ALU209"] == [("ALU209", Severity.WARNING)]


def test_an_execution_is_asked_by_properties_only(tmp_path):
    path = tmp_path / "x.rl"
    path.write_text("skillset s { skill f { precondition p: not f running success ok } }")
    assert [(d.code, d.span.column) for d in check_file(path)[1]] == [("ALU223", 44)]


def test_what_code_can_not_be_generated_of_is_told_as_an_error_when_it_shall_be(tmp_path):
    (tmp_path / "x.rl").write_text("skillset Robot { skill f { } }")
    assert {d.code: d.severity for d in check_file(tmp_path / "x.rl")[1]} == dict.fromkeys(("ALU216", "ALU218"), Severity.WARNING)
    with pytest.raises(LanguageError) as caught:
        load_robot(tmp_path)
    assert {d.code: d.severity for d in caught.value.diagnostics} == dict.fromkeys(("ALU216", "ALU218"), Severity.ERROR)


def test_a_sound_skillset_has_no_findings():
    assert check(parse(f"skillset s {{ {AXES} {LINK} skill f {{ {TAKE} precondition {{ success take }} {END} }} }}")) == []


def test_the_name_of_a_package():
    (finding,) = check(parse("skillset My_Skills { }", "x"))
    assert finding.code == "ALU216"
    assert "name of a ROS package" in finding.message


def test_every_code_has_a_test():
    tested = {row[0] for row in SYNTAX + SEMANTICS}
    elsewhere = {"ALU001", "ALU002", "ALU003", "ALU005", "ALU006", "ALU107", "ALU401", "ALU402", "ALU403", "ALU404", "ALU405"}
    elsewhere |= {"ALU109", "ALU110", "ALU223", "ALU224", "ALU225", "ALU229", "ALU305", "ALU307"}
    assert tested | elsewhere == set(CODES) - set(PROOF_CODES) - set(MISSION_CODES) - set(RUN_CODES)
