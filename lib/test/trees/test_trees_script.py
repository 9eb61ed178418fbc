"""The scripting language beyond what BT.CPP can tell: places, cures, extensions of ours, hostile texts."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from trees_scripts import WORDS, World

from alula.trees.script import Reference, ScriptError, parse, truth
from alula.trees.script.lexer import MAX_CHARACTERS
from alula.trees.script.parser import MAX_DEPTH
from alula.trees.script.values import MAX_TEXT, ValueMismatch


def run(script, **entries):
    world = World(dict(entries), {"RED": 1, "BLUE": 3})
    return parse(script).run(world), world


REFUSED = (
    ("", 0, "an empty script", "take the attribute away"),
    ("  ", 0, "an empty script", ""),
    ("a := ", 5, "the end of the script", "too early"),
    ("a := (1", 7, "`)` was expected", "every `(`"),
    ("a ? 1", 5, "`:` was expected", "other value"),
    ("a := b := 1", 7, "inside of an assignment", "brackets"),
    ("a ? 1 : b ? 2 : 3", 10, "second `?`", "brackets"),
    ("a b", 2, "`b` was not expected", "`;` stands between"),
    ("a and b", 2, "`and`", "`&&`"),
    ("not a", 4, "`a` was not expected", "`!`"),
    ("a := 'it", 5, "closing quote", "close it with '"),
    ("a := 3x", 5, "`3` goes on", ""),
    ("a % 2", 2, "`%` means nothing", "no remainder"),
    ("{a} == 1", 0, "`{` means nothing", "without braces"),
    ("a == .5", 5, "`.` means nothing", "begins with a digit"),
    ("a.b := 1", 0, "`a.b` can't be assigned to", "without a dot"),
    ("f(1, ", 5, "a value was expected", ""),
)


@pytest.mark.parametrize(("script", "offset", "message", "cure"), REFUSED)
def test_a_refusal_names_place_and_cure(script, offset, message, cure):
    with pytest.raises(ScriptError) as refusal:
        parse(script)
    assert refusal.value.offset == offset
    assert message in refusal.value.message
    assert cure in refusal.value.cure
    assert "\n" not in str(refusal.value)


FAILED = (
    ("x == 1", 0, 1, "there is no `x`"),
    ("a := 1 + x", 9, 10, "there is no `x`"),
    ("x = 1", 0, 1, "no entry `x` yet"),
    ("n + 1", 0, 5, "the left operand of `+` has no value yet"),
    ("i = 1.5", 0, 7, "1.5 is no integer"),
    ("t = 3", 0, 5, "an integer for an entry that holds a text"),
    ("i && 1", 0, 6, "the integer 3 is neither true nor false"),
    ("t ? 1 : 2", 0, 1, "is no number"),
    ("1 := 2", 0, 1, "only an entry"),
    ("o + 1", 0, 5, "`+` between a list and an integer"),
    ("~(0 / 0)", 0, 7, "nan is out of range"),
    ("gone(a)", 0, 7, "no function `gone`"),
    ("progress(1) > 0", 0, 11, "takes the name of a skill"),
)


@pytest.mark.parametrize(("script", "offset", "end", "message"), FAILED)
def test_a_failure_names_its_place(script, offset, end, message):
    with pytest.raises(ScriptError) as failure:
        run(script, a=1, n=None, i=3, t="text", o=[])
    assert (failure.value.offset, failure.value.end) == (offset, end)
    assert message in failure.value.message


def test_enums_come_before_entries_and_stand_in_texts():
    assert run("RED + 1", RED=9)[0] == 2.0
    assert run("'BLUE' == 3")[0] == 1.0
    assert run("color == BLUE", color="BLUE")[0] == 1.0
    assert run("n = 'BLUE'", n=1)[1].entries["n"] == 3.0


def test_dotted_names_are_read():
    program = parse("navigation.flight_status == 'IN_AIR' && navigation.guidance_state.obstacle_m<2")
    world = World({"navigation.flight_status": "IN_AIR", "navigation.guidance_state.obstacle_m": 1.5})
    assert program.judge(world) is True
    assert parse("a.b..c.d").run(World({"a.b": "x", "c.d": "y"})) == "xy"


def test_calls_take_names_as_they_are_and_else_values():
    value, world = run("running(navigation.goto) && running(1 + 1, 'x', b) == 0", b=5)
    assert value == 1.0
    assert world.calls == [("running", ["navigation.goto"]), ("running", [2.0, "x", "b"])]
    assert isinstance(world.calls[1][1][2], Reference)
    assert not isinstance(world.calls[1][1][1], Reference)


def test_both_sides_of_and_are_evaluated_and_one_branch():
    with pytest.raises(ScriptError, match="no `x`"):
        run("0 && x")
    assert run("1 ? 2 : x")[0] == 2


def test_names_are_told_by_what_is_done_to_them():
    names = parse("a := b + @c; d = RED; e += 1; running(nav.goto) ? nav.state == UP : f(g + 1)").names
    assert names.written == {"a", "d", "e"}
    assert names.replaced == {"a", "d"}
    assert names.read == {"b", "@c", "RED", "e", "nav.state", "UP", "g"}
    assert names.asked == {"nav.goto"}
    assert names.called == {"running", "f"}


def test_an_entry_keeps_its_type():
    assert run("a := 1; a = 2.0")[1].entries["a"] == 2
    assert isinstance(run("a := 1; a = 2.0")[1].entries["a"], int)
    assert run("flag = 1", flag=False)[1].entries["flag"] is True


@pytest.mark.parametrize(("value", "expected"), [(0, False), (1, True), (True, True), (0.0, False), (0.1, True), (float("nan"), True)])
def test_truth_is_what_bt_cpp_casts(value, expected):
    assert truth(value) is expected


@pytest.mark.parametrize("value", [2, -1, -0.5, "true", None, []])
def test_what_is_neither_true_nor_false_is_refused(value):
    with pytest.raises(ValueMismatch, match="neither true nor false"):
        truth(value)


def test_a_condition_that_is_neither_has_a_place():
    with pytest.raises(ScriptError) as failure:
        parse("1; 'x'").judge(World())
    assert failure.value.offset == 3


HOSTILE = (
    "(" * 5000,
    "!" * 5000 + "a",
    "-(" * 3000 + "1" + ")" * 3000,
    "f(" * 3000 + "1" + ")" * 3000,
    "a ? " * 3000 + "1" + " : 2" * 3000,
    "a" * (MAX_CHARACTERS + 1),
    "1" * MAX_CHARACTERS,
)


@pytest.mark.parametrize("script", HOSTILE)
def test_hostile_texts_are_refused_in_one_line(script):
    with pytest.raises(ScriptError) as refusal:
        parse(script)
    assert len(str(refusal.value)) < 200


def test_the_deepest_script_that_is_read_runs():
    """Every level of operators in every bracket, as deep as is allowed."""
    level = "a := 0 ? 1 : 0 || 1 && 1 == 1 | 1 & 1 + 1 * ("
    assert run(level * (MAX_DEPTH - 1) + "1" + ")" * (MAX_DEPTH - 1))[0] is not None


def test_a_long_sum_is_no_deep_tree():
    count = MAX_CHARACTERS // 2
    assert run("+".join(["1"] * count))[0] == count


def test_a_text_that_doubles_has_an_end():
    with pytest.raises(ScriptError, match=f"{MAX_TEXT} characters"):
        run("a := 'x'; " + ";".join(["a += a"] * 40))


@given(st.lists(st.sampled_from((*WORDS, "f(", "a.b", ",", "\\\n", "é", "%", "'")), max_size=40).map(" ".join) | st.text(max_size=60))
@example("a := 1e999999999")
def test_any_text_is_run_or_refused(text):
    try:
        run(text, a=1, b="x", c=2.5, d=None)
    except ScriptError as refusal:
        error = refusal
    else:
        return
    assert 0 <= error.offset <= len(text)
    assert error.end > error.offset
    assert error.message
