"""Formulas of behaviour files: Python's values where both languages have the notation, the skill language's words elsewhere."""

from __future__ import annotations

import random
from types import SimpleNamespace

import pytest

from alula.mock.formula import FUNCTIONS, Formula, FormulaError

NAMES = {"a": 3, "b": -0.5, "far": [4.0, 0.0, 2.5], "spot": SimpleNamespace(x=1.0, y=-2.0), "link": "UP", "door": "left"}
CHANCE = random.Random(1)  # noqa: S311 - repeatable
RESOURCES = {"link": ("UP", "DOWN")}
NUMBERS = ("0", "2", "-1", "0.25", "-3.5", "1e2", "a", "b", "far[0]", "far[a - 1]", "spot.x", "spot.y")


def _number(draw, depth):
    """Return a term that has a number, or a division by 0, in Python and here."""
    if depth == 0 or draw.random() < 0.15:
        return draw.choice(NUMBERS)
    one, other = _number(draw, depth - 1), _number(draw, depth - 1)
    join = draw.choice(("+", "-", "*", "/", " + ", " - ", " * ", " / ", " -", "- "))
    return draw.choice(
        (
            f"{one}{join}{other}",
            f"{one}{join}{other}",
            f"({one})",
            f"-{one}",
            f"max({one}, {other})",
            f"distance([{one}, 1], [0, {other}])",
            f"({one} if {_truth(draw, depth - 1)} else {other})",
        )
    )


def _truth(draw, depth):
    if depth == 0 or draw.random() < 0.3:
        return f"{_number(draw, depth)} {draw.choice(('<', '<=', '>', '>=', '==', '!='))} {_number(draw, depth)}"
    one, other = _truth(draw, depth - 1), _truth(draw, depth - 1)
    return draw.choice((f"not {one}", f"{one} and {other}", f"{one} or {other}", f"({one})"))


def test_what_is_python_too_has_pythons_value():
    draw = random.Random(5)  # noqa: S311 - repeatable
    for _ in range(1500):
        text = draw.choice((_number, _truth))(draw, draw.randrange(5))
        formula = Formula(text)
        try:
            expected = eval(text, {"__builtins__": {}, **FUNCTIONS, **NAMES})  # noqa: S307 - the oracle, of texts that are made here
        except ZeroDivisionError:
            with pytest.raises(FormulaError, match="ZeroDivisionError"):
                formula(NAMES, CHANCE)
        else:
            assert repr(formula(NAMES, CHANCE)) == repr(expected), text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("link == UP", True),
        ("link != UP", False),
        ("20 if link == UP else 2", 20),
        ("link", "UP"),
        ("door == 'left'", True),
        ('door == "left"', True),
        ("a > 2 => door == 'left'", True),
        ("false => 1", True),
        ("500 ms", 0.5),
        ("20 % * 10", 2.0),
        ("36 km/h / 2", 5.0),
        ("6 m / 3", 2.0),
        ("mod(7, a)", 1),
        ("a - 1", 2),
        ("a-1", 2),
        ("a -1 * 2", 1),
        ("true or 1", True),
        ("far[0] if true else far[9]", 4.0),
    ],
)
def test_the_skill_languages_words_and_units_are_read(text, value):
    assert Formula(text, RESOURCES)(NAMES, CHANCE) == value


REFUSED = {
    'link == "UP"': 'expected a state, found `"UP"` (character 9); write `link == UP`',
    "link == UPP": "resource link has no state UPP; it has UP, DOWN (did you mean `UP`?) (character 9)",
    "0 < a < 9": "expected an operator, found `<` (character 7); compare two at a time: `0 < t and t < 9`",
    "a % 3": "expected an operator, found `%` (character 3); `%` is a unit; for the rest of a division write `mod(a, b)`",
    "10 % 3": "expected an operator, found `3` (character 6); `%` is a unit",
    "(1, 2)": "expected `)`, found `,` (character 3); a list is written `[a, b]`",
    "a // 3": "`//` and `/*` begin comments, which a formula doesn't have",
    "True": "expected a value, found `True` (character 1); write `true`",
    "a if b": "expected `else`, found the end of the formula (character 7)",
    "a ** 2": "expected a value, found `*` (character 4)",
    "lambda: 3": "expected an operator, found `:` (character 7)",
    "max(1 2)": "expected `,` or `)`, found `2`",
    "spot._x": "the field _x is not allowed in formulas",
    "'open": "the string has no closing `'` on its line",
    "hypott(1, 2)": "there is no function hypott; there are distance",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_formula_is_refused_with_place_and_remedy(text):
    with pytest.raises(FormulaError) as error:
        Formula(text, RESOURCES)
    assert str(error.value).startswith(f"`{text}`: ")
    assert REFUSED[text] in str(error.value)


@pytest.mark.parametrize("text", ["1 if a else 2", "not a", "a or 5", "a and true", "a => true"])
def test_a_number_is_no_truth_value(text):
    with pytest.raises(FormulaError, match=r"TypeError: 3 is neither true nor false"):
        Formula(text)(NAMES, CHANCE)


@pytest.mark.parametrize(
    "text", ["(" * 500 + "1" + ")" * 500, "[" * 500, "not " * 500 + "true", "abs(" * 500, "1 if true else " * 500 + "1"]
)
def test_what_is_nested_too_deep_is_refused(text):
    with pytest.raises(FormulaError, match="nested more than"):
        Formula(text)


def test_a_long_formula_has_a_value():
    assert Formula(" + ".join(["1"] * 5000))({}, CHANCE) == 5000
    assert Formula("-" * 5000 + "1")({}, CHANCE) == 1
