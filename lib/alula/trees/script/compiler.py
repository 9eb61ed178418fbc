"""From a syntax tree to what runs, as BT.CPP's ``operators.hpp`` evaluates it.

`&&` and `||` evaluate both sides, but for the comparison of a state that decides nothing; `?:` evaluates one branch, a comparison stops at
the first pair that fails. Arithmetic gives doubles.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import TypeAlias, cast

from alula.trees.script.errors import ScriptError
from alula.trees.script.scope import Reference, Scope, Unknown, Value
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Conditional, Literal, Name, Node, Prefix
from alula.trees.script.values import ValueMismatch, as_float, as_integer, as_text, fitted, is_number, joined, kind, number_or_enum, truth

Code: TypeAlias = Callable[[Scope], Value]

EPSILON = 2.0**-23
"""Numbers that differ by no more are equal: C++'s ``std::numeric_limits<float>::epsilon()``."""


def compile_node(node: Node) -> Code:
    """Return a function that evaluates a node in a scope and raises ScriptError where BT.CPP throws."""
    match node:
        case Literal(value=value):
            return lambda _: value
        case Name():
            return _name(node)
        case Call():
            return _call(node)
        case Prefix():
            return _prefix(node)
        case Chain():
            return _chain(node)
        case Comparison():
            return _comparison(node)
        case Conditional():
            return _conditional(node)
        case Assignment():
            return _assignment(node)


def _error(error: ValueMismatch, offset: int, end: int) -> ScriptError:
    return ScriptError(str(error), offset, end=end, cure=error.cure)


def _refusal(error: Exception) -> str:
    """Return a scope's own words, without the quotes that ``str`` adds to a KeyError."""
    return " ".join(str(argument) for argument in error.args)


def _name(node: Name) -> Code:
    name = node.name

    def read(scope: Scope) -> Value:
        if name in scope.enums:
            return float(scope.enums[name])
        try:
            return scope.get(name)
        except KeyError as error:
            raise ScriptError(f"there is no `{name}`", node.offset, end=node.end, cure="`:=` makes an entry") from error
        except (ValueError, TypeError) as error:
            raise ScriptError(_refusal(error), node.offset, end=node.end) from error

    return read


def _call(node: Call) -> Code:
    codes = [_argument(argument) for argument in node.arguments]

    def ask(scope: Scope) -> Value:
        arguments = [code(scope) for code in codes]
        try:
            return scope.call(node.function, arguments)
        except KeyError as error:
            raise ScriptError(f"there is no function `{node.function}`", node.offset, end=node.end) from error
        except (ValueError, TypeError) as error:
            raise ScriptError(_refusal(error), node.offset, end=node.end) from error

    return ask


def _argument(node: Node) -> Code:
    if isinstance(node, Name):
        reference = Reference(node.name)
        return lambda _: reference
    return compile_node(node)


def _number(value: Value, symbol: str) -> float:
    """Return a number as a double; refuse texts, which other operators would read as numbers."""
    if not is_number(value):
        raise ValueMismatch(f"`{symbol}` of {kind(value)}")
    return as_float(value)


def _complement(value: float) -> float:
    if not abs(value) <= 2.0**63:  # a number that is none is out of range, too
        raise ValueMismatch(f"{value:g} is out of range for `~`")
    return float(~int(value))


_PREFIXES: dict[str, Callable[[float], float]] = {"-": operator.neg, "~": _complement, "!": lambda value: float(not value)}


def _prefix(node: Prefix) -> Code:
    operand, apply = compile_node(node.operand), _PREFIXES[node.operator]

    def run(scope: Scope) -> Value:
        value = operand(scope)
        if isinstance(value, Unknown):
            return value
        try:
            return apply(_number(value, node.operator))
        except ValueMismatch as error:
            raise _error(error, node.offset, node.end) from error

    return run


def _divide(left: float, right: float) -> float:
    try:
        return left / right  # which a number that nobody knows answers itself, on either side
    except ZeroDivisionError:
        return math.nan if left == 0 or math.isnan(left) else math.copysign(math.inf, left) * math.copysign(1.0, right)


_ARITHMETIC: dict[str, Callable[[float, float], float]] = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": _divide}
_BITS: dict[str, Callable[[int, int], int]] = {"&": operator.and_, "|": operator.or_, "^": operator.xor}


def _combine(symbol: str, left: Value, right: Value) -> Value:
    """Return what a binary operator makes of two values; raise ValueMismatch where BT.CPP throws."""
    for side, value in (("left", left), ("right", right)):
        if value is None:
            raise ValueMismatch(f"the {side} operand of `{symbol}` has no value yet")
    if isinstance(left, Unknown) or isinstance(right, Unknown):
        return _of_unknown(symbol, left, right)
    texts = isinstance(left, str) + isinstance(right, str)
    if symbol == "+" and texts == 2:
        return joined(as_text(left), as_text(right))
    if symbol == ".." and texts and all(isinstance(value, str) or is_number(value) for value in (left, right)):
        return joined(as_text(left), as_text(right))
    if symbol == ".." or not (is_number(left) and is_number(right)):
        cure = "one side has to be a text: `1 .. ''`" if symbol == ".." else "`..` joins texts and numbers" if texts else ""
        raise ValueMismatch(f"`{symbol}` between {kind(left)} and {kind(right)}", cure)
    a, b = as_float(left), as_float(right)
    if symbol in _ARITHMETIC:
        return _ARITHMETIC[symbol](a, b)
    if symbol in _BITS:
        return float(_BITS[symbol](as_integer(left), as_integer(right)))
    first, second = truth(left), truth(right)
    return float(first and second) if symbol == "&&" else float(first or second)


def _of_unknown(symbol: str, left: Value, right: Value) -> Value:
    """Return what an operator makes of two values one of which at least is unknown: what the other decides, else the unknown."""
    unknown, other = (left, right) if isinstance(left, Unknown) else (right, left)
    if symbol in {"&&", "||"} and is_number(other) and truth(other) == (symbol == "||"):
        return float(symbol == "||")
    return unknown


_DECIDES = {"&&": 0.0, "||": 1.0}
"""The left operand with which the right one decides nothing."""


def _asks_only(node: Node) -> bool:
    """Return whether nothing but its value comes of an operand: a robot's resource or data is compared with the name of a state.

    Where that decides nothing it is not asked, which nobody sees, and a search of all runs has less to look at.
    """
    if not (isinstance(node, Comparison) and len(node.operators) == 1 and node.operators[0] in {"==", "!="}):
        return False
    dotted = [isinstance(one, Name) and "." in one.name for one in node.operands]
    return sorted(dotted) == [False, True] and all(isinstance(one, Name) for one in node.operands)


def _chain(node: Chain) -> Code:
    first, *rest = (compile_node(operand) for operand in node.operands)
    steps = list(zip(node.operators, rest, node.operands[1:], map(_asks_only, node.operands[1:]), strict=True))

    def run(scope: Scope) -> Value:
        value = first(scope)
        for symbol, code, place, asks_only in steps:
            if asks_only and type(value) is float and value == _DECIDES.get(symbol):
                continue
            right = code(scope)
            try:
                value = _combine(symbol, value, right)
            except ValueMismatch as error:
                raise _error(error, node.offset, place.end) from error
        return value

    return run


def _same(left: float, right: float) -> bool:
    return abs(left - right) <= EPSILON


# Orders are written as what they exclude: with a number that is none, every order holds, as in BT.CPP.
_NUMBERS: dict[str, Callable[[float, float], bool]] = {
    "==": _same,
    "!=": lambda left, right: not _same(left, right),
    "<": lambda left, right: not left >= right,
    ">": lambda left, right: not left <= right,
    "<=": lambda left, right: not left > right,
    ">=": lambda left, right: not left < right,
}
_TEXTS: dict[str, Callable[[str, str], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}


def _holds(symbol: str, left: Value, right: Value, scope: Scope) -> bool | Unknown:
    if isinstance(left, Unknown):
        return left
    if isinstance(right, Unknown):
        return right
    if isinstance(left, str) and isinstance(right, str):
        return _TEXTS[symbol](left, right)
    sides = []
    for side, value in (("left", left), ("right", right)):
        if value is None:
            raise ValueMismatch(f"the {side} operand of `{symbol}` has no value yet")
        if not isinstance(value, str) and not is_number(value):
            raise ValueMismatch(f"`{symbol}` between {kind(left)} and {kind(right)}")
        sides.append(number_or_enum(value, scope.enums) if isinstance(value, str) else as_float(value))
    return _NUMBERS[symbol](*sides)


def _comparison(node: Comparison) -> Code:
    first, *rest = (compile_node(operand) for operand in node.operands)
    steps = list(zip(node.operators, rest, node.operands[1:], strict=True))

    def run(scope: Scope) -> Value:
        left = first(scope)
        answer: Value = 1.0
        for symbol, code, place in steps:
            right = code(scope)
            try:
                holds = _holds(symbol, left, right, scope)
            except ValueMismatch as error:
                raise _error(error, node.offset, place.end) from error
            if not holds:
                return 0.0
            if isinstance(holds, Unknown):
                answer = holds
            left = right
        return answer

    return run


def _conditional(node: Conditional) -> Code:
    condition, then, otherwise = compile_node(node.condition), compile_node(node.then), compile_node(node.otherwise)

    def run(scope: Scope) -> Value:
        asked = condition(scope)
        if isinstance(asked, Unknown):
            return asked
        try:
            chosen = then if as_float(asked) != 0 else otherwise
        except ValueMismatch as error:
            raise _error(error, node.condition.offset, node.condition.end) from error
        return chosen(scope)

    return run


def _assignment(node: Assignment) -> Code:
    if not isinstance(node.target, Name):

        def refuse(_: Scope) -> Value:
            raise ScriptError("only an entry can be assigned to", node.target.offset, end=node.target.end)

        return refuse
    name, compute = node.target.name, compile_node(node.value)

    def assign(scope: Scope) -> Value:
        old = _old(scope, node, name)
        value = compute(scope)
        try:
            new = _assigned(node.operator, old(), value, scope)
            scope.set(name, new, create=node.operator == ":=")
        except ValueMismatch as error:
            raise ScriptError(f"`{name}` {node.operator} ...: {error}", node.offset, end=node.end, cure=error.cure) from error
        except (KeyError, ValueError, TypeError) as error:
            raise ScriptError(_refusal(error), node.offset, end=node.end) from error
        return new

    return assign


def _old(scope: Scope, node: Assignment, name: str) -> Callable[[], Value]:
    """Return what reads the entry's value when the right side has been computed, which may write it; refuse an entry that is missing."""
    try:
        scope.get(name)
    except KeyError as error:
        if node.operator != ":=":
            place = cast("Name", node.target)
            raise ScriptError(f"there is no entry `{name}` yet", place.offset, end=place.end, cure="make it with `:=`") from error

    def read() -> Value:
        try:
            return scope.get(name)
        except KeyError:
            return None

    return read


def _assigned(symbol: str, old: Value, value: Value, scope: Scope) -> Value:
    if value is None:
        raise ValueMismatch("the right side has no value yet")
    if isinstance(value, Unknown):
        raise ValueMismatch(f"the right side is unknown: {value}", "ask for data in conditions")
    if symbol in {":=", "="}:
        return fitted(value, old, scope.enums)
    if old is None:
        raise ValueMismatch("the entry has no value yet")
    if isinstance(value, str) and symbol == "+=" and isinstance(old, str):
        return joined(old, value)
    if not (is_number(value) and is_number(old)):
        raise ValueMismatch(f"`{symbol}` between {kind(old)} and {kind(value)}")
    return fitted(_ARITHMETIC[symbol[0]](as_float(old), as_float(value)), old, scope.enums)
