"""From a script's text to a Program, with BT.CPP's operators and their order.

What BT.CPP 4.8 and 4.9 read differently is read as 4.9 reads it, and noted (``Program.notes``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

from alula.trees.script import portability
from alula.trees.script.errors import ScriptError
from alula.trees.script.lexer import Kind, Token, tokenize
from alula.trees.script.program import Note, Program
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Conditional, Literal, Name, Node, Prefix

MAX_DEPTH = 24
"""How deep brackets, prefixes and branches may nest."""

COMPARISONS = frozenset({"==", "!=", "<", ">", "<=", ">="})
ASSIGNMENTS = frozenset({":=", "=", "+=", "-=", "*=", "/="})
LEVELS = {
    "||": 1,
    "&&": 2,
    **dict.fromkeys(COMPARISONS, 3),
    "|": 4,
    "^": 4,
    "&": 5,
    "+": 6,
    "-": 6,
    "..": 6,
    "*": 7,
    "/": 7,
}
"""How tightly a binary operator binds."""

_WORDS = {"and": "&&", "or": "||", "not": "!", "xor": "^", "True": "true", "False": "false"}


@lru_cache(maxsize=256)
def parse(text: str) -> Program:
    """Read a script; raise ScriptError with the place of the first thing that is wrong. An empty script is wrong, too.

    A program keeps nothing of its runs, so equal texts share one: a subtree that is used often is read once.
    """
    return _Parser(text).program()


def statements_of(text: str) -> tuple[Node, ...]:
    """Return the statements of a script, none where it can't be read: the check of its file has said so then."""
    try:
        return parse(text).statements
    except ScriptError:
        return ()


@dataclass
class _Begun:
    """Operators of one level that still wait for their last operand."""

    level: int
    operators: list[Token] = field(default_factory=list)
    operands: list[Node] = field(default_factory=list)

    def closed(self, last: Node) -> Node:
        """Return the node, with its last operand."""
        made = Comparison if self.operators[0].text in COMPARISONS else Chain
        symbols, places = tuple(one.text for one in self.operators), tuple(one.offset for one in self.operators)
        return made(symbols, (*self.operands, last), places, self.operands[0].offset, last.end)


class _Parser:
    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = tokenize(text)
        self._next = 0
        self._depth = 0
        self._notes: list[Note] = []
        self._groups = portability.Groups()

    def program(self) -> Program:
        if self._peek().kind is Kind.END:
            raise ScriptError("an empty script", 0, cure="write an expression, or take the attribute away")
        statements = [self._statement()]
        while self._peek().text == ";":
            separator = self._advance()
            if self._peek().kind is Kind.END:
                self._notes.append(portability.trailing_semicolon(separator))
                break
            statements.append(self._statement())
        if self._peek().kind is not Kind.END:
            raise self._unexpected()
        extended = portability.extended(statements)
        notes = [] if extended else [*self._notes, *portability.of_tokens(self._text, self._tokens)]
        return Program(self._text, tuple(statements), tuple(sorted(notes, key=lambda note: note.offset)))

    def _peek(self) -> Token:
        return self._tokens[self._next]

    def _advance(self) -> Token:
        token = self._peek()
        if token.kind is not Kind.END:
            self._next += 1
        return token

    def _expect(self, text: str, cure: str) -> Token:
        if self._peek().text != text or self._peek().kind is not Kind.OPERATOR:
            raise ScriptError(f"`{text}` was expected, not {self._peek().shown}", self._peek().offset, end=self._peek().end, cure=cure)
        return self._advance()

    def _unexpected(self) -> ScriptError:
        token = self._peek()
        before = self._tokens[self._next - 1] if self._next else token
        cure = ""
        if token.text in _WORDS or before.text in _WORDS:
            word = token.text if token.text in _WORDS else before.text
            cure = f"BT.CPP writes `{_WORDS[word]}`"
        elif token.kind is not Kind.OPERATOR:
            cure = "`;` stands between two statements"
        return ScriptError(f"{token.shown} was not expected here", token.offset, end=token.end, cure=cure)

    def _statement(self) -> Node:
        self._groups = portability.Groups()
        return self._expression()

    def _nested(self) -> Node:
        """Read an expression in brackets, whose operators 4.8 does not hold against those outside."""
        outside, self._groups = self._groups, portability.Groups()
        inside = self._expression()
        self._groups = outside
        return inside

    def _expression(self) -> Node:
        self._descend()
        left = self._conditional()
        if self._peek().text in ASSIGNMENTS and self._peek().kind is Kind.OPERATOR:
            symbol = self._advance().text
            if isinstance(left, Name) and "." in left.name:
                cure = "an entry's name is without a dot"
                raise ScriptError(f"`{left.name}` can't be assigned to", left.offset, end=left.end, cure=cure)
            value = self._conditional()
            if self._peek().text in ASSIGNMENTS and self._peek().kind is Kind.OPERATOR:
                raise ScriptError(
                    "an assignment inside of an assignment",
                    self._peek().offset,
                    end=self._peek().end,
                    cure="put it in brackets: `a := (b := 1)`",
                )
            left = Assignment(symbol, left, value, left.offset, value.end)
        self._depth -= 1
        return left

    def _descend(self) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ScriptError(f"nested deeper than {MAX_DEPTH}", self._peek().offset, cure="divide it into statements", excess=True)

    def _conditional(self) -> Node:
        condition = self._binary()
        if self._peek().text != "?" or self._peek().kind is not Kind.OPERATOR:
            return condition
        self._advance()
        then = self._nested()
        self._expect(":", "`condition ? value : other value`")
        otherwise = self._binary()
        if self._peek().text == "?":
            raise ScriptError(
                "a second `?` without brackets", self._peek().offset, end=self._peek().end, cure="put it in brackets: `a ? 1 : (b ? 2 : 3)`"
            )
        return Conditional(condition, then, otherwise, condition.offset, otherwise.end)

    def _binary(self) -> Node:
        """Read prefixes and what joins them, with a stack of its own: depth is spent by brackets alone."""
        begun: list[_Begun] = []
        operand = self._prefix()
        while True:
            token = self._peek()
            level = LEVELS.get(token.text, 0) if token.kind is Kind.OPERATOR else 0
            while begun and begun[-1].level > level:
                operand = begun.pop().closed(operand)
            if not level:
                return operand
            self._note(self._groups.meet(self._advance()))
            if not begun or begun[-1].level < level:
                self._note(portability.logic_order(token) if token.text == "&&" and begun else None)
                begun.append(_Begun(level))
            elif begun[-1].operators:
                self._note(portability.order(begun[-1].operators[-1], token))
            begun[-1].operands.append(operand)
            begun[-1].operators.append(token)
            operand = self._prefix()

    def _note(self, note: Note | None) -> None:
        if note is not None:
            self._notes.append(note)

    def _prefix(self) -> Node:
        token = self._peek()
        if token.kind is Kind.OPERATOR and token.text in {"-", "~", "!"}:
            self._descend()
            self._note(self._groups.meet(self._advance()))
            operand = self._prefix()
            self._depth -= 1
            return Prefix(token.text, operand, token.offset, operand.end)
        if token.text == "(" and token.kind is Kind.OPERATOR:
            self._advance()
            inside = self._nested()
            self._expect(")", "every `(` needs its `)`")
            return inside
        return self._atom(self._advance())

    def _atom(self, token: Token) -> Node:
        match token.kind:
            case Kind.NUMBER:
                return Literal(_number(token), token.offset, token.end)
            case Kind.STRING:
                return Literal(token.text[1:-1], token.offset, token.end)
            case Kind.NAME if token.text in {"true", "false"}:
                return Literal(int(token.text == "true"), token.offset, token.end)
            case Kind.NAME if self._peek().text == "(" and self._peek().kind is Kind.OPERATOR:
                return self._call(token)
            case Kind.NAME:
                return Name(token.text, token.offset, token.end)
        following = self._peek()
        if token.text == "+" and following.kind is Kind.NUMBER and following.offset == token.end:
            # BT.CPP 4.8 takes the sign for a part of the number.
            self._notes.append(portability.signed_number(token))
            self._advance()
            return Literal(_number(following), token.offset, following.end)
        cure = "an entry, a number or a text in single quotes" if token.kind is Kind.OPERATOR else "the script ends too early"
        raise ScriptError(f"a value was expected, not {token.shown}", token.offset, end=token.end, cure=cure)

    def _call(self, name: Token) -> Node:
        self._advance()
        arguments: list[Node] = []
        while self._peek().text != ")" or self._peek().kind is not Kind.OPERATOR:
            arguments.append(self._nested())
            if self._peek().text != ",":
                break
            self._advance()
        end = self._expect(")", "arguments are separated by `,` and end with `)`").end
        return Call(name.text, tuple(arguments), name.offset, end)


def _number(token: Token) -> float:
    """Return a NUMBER token's value: an ``int`` of 64 bits, or a ``float`` where it has a fraction or an exponent."""
    text = token.text.lower()
    if text.startswith("0x") or text.isdigit():
        value = int(text, 16 if text.startswith("0x") else 10) if len(text) <= 20 else 2**63
        if value < 2**63:
            return value
        raise ScriptError(f"{token.shown} is too large for an integer", token.offset, end=token.end, cure="write it with a decimal point")
    number = float(text)
    tiny = number < 2.0**-1022 and any(digit in "123456789" for digit in text.split("e")[0])
    if tiny or math.isinf(number):
        raise ScriptError(f"{token.shown} is out of a number's range", token.offset, end=token.end)
    return number
