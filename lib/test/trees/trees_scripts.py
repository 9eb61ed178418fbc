"""Scripts for tests: a scope, BT.CPP itself, and random scripts."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

import behaviortreepy

from alula.trees.script import Reference, ScriptError, parse
from alula.trees.script.values import ValueMismatch, as_float, as_text


@dataclass
class World:
    """A scope of entries, enums and functions in plain dictionaries."""

    entries: dict[str, object] = field(default_factory=dict)
    enums: Mapping[str, float] = field(default_factory=dict)
    calls: list[tuple[str, list[object]]] = field(default_factory=list)

    def get(self, name: str) -> object:
        return self.entries[name]

    def set(self, name: str, value: object, *, create: bool) -> None:
        if name not in self.entries and not create:
            raise KeyError(name)
        self.entries[name] = value

    def call(self, name: str, args: Sequence[object]) -> object:
        self.calls.append((name, list(args)))
        if name == "running":
            return args == [Reference("navigation.goto")]
        if name == "progress":
            raise ValueError("progress() takes the name of a skill")
        raise KeyError(name)


class Oracle:
    """BehaviorTree.CPP itself."""

    def __init__(self) -> None:
        self._factory = behaviortreepy.BehaviorTreeFactory()

    def run(self, script: str) -> tuple[str, dict[str, tuple[object, ...]]]:
        """Return `parse` or `run` for where it failed, or `ok`, and the blackboard's entries as each of its readers gives them."""
        code = quoteattr(script, {"\n": "&#10;", "\t": "&#9;", "\r": "&#13;"})
        xml = f'<root BTCPP_format="4"><BehaviorTree ID="T"><Script code={code}/></BehaviorTree></root>'
        try:
            tree = self._factory.create_tree_from_text(xml)
        except (RuntimeError, IndexError):  # std::out_of_range comes as the latter
            return "parse", {}
        board = tree.root_blackboard()
        try:
            tree.tick_exactly_once()
        except (RuntimeError, IndexError):
            return "run", {}
        return "ok", {key: self._read(board, key) for key in board.get_keys()}

    @staticmethod
    def _read(board: behaviortreepy.Blackboard, key: str) -> tuple[object, ...]:
        found: list[object] = []
        for reader in ("get_double", "get_string"):
            try:
                value = getattr(board, reader)(key)
                found.append("nan" if value != value else value)  # noqa: PLR0124
            except (RuntimeError, IndexError):
                found.append(None)
        # The sign of what is no number is the processor's: C prints `-nan` for 0/0.
        return tuple(value.replace("-nan", "nan") if isinstance(value, str) else value for value in found)


def ours(script: str) -> tuple[str, dict[str, tuple[object, ...]]]:
    """Return the same of our own."""
    world = World()
    try:
        program = parse(script)
    except ScriptError:
        return "parse", {}
    try:
        program.run(world)
    except ScriptError:
        return "run", {}
    return "ok", {key.removeprefix("@"): (_double(value), as_text(value).replace("-nan", "nan")) for key, value in world.entries.items()}


def _double(value: object) -> object:
    try:
        number = as_float(value)
    except ValueMismatch:
        return None
    return "nan" if math.isnan(number) else number


NUMBERS = ("0", "1", "2", "3", "7", "0.5", "1.5", "2.0", "1e3", "0x1F", "9007199254740993", "1e300", "4611686018427387904", "1e19", "+4")
TEXTS = ("''", "'x'", "'abc'", "'3'", "'-2.5'", "'true'", "'1e2y'", "' 7'", "'inf'", '"quoted"')
NAMES = ("a", "b", "c", "d", "_e1", "@f")
WORDS = (
    *NUMBERS,
    *TEXTS,
    *NAMES,
    "true",
    "false",
    *"+-*/&|^~!<>=?:();",
    "==",
    "!=",
    "<=",
    ">=",
    "&&",
    "||",
    "..",
    ":=",
    "+=",
    "-=",
    "(",
    ")",
)


NUMERIC, TEXTUAL = ("a", "b", "c", "@f"), ("d", "_e1")
"""Names that mostly hold the one or the other: scripts that fail at once show little."""


def random_expression(chance: random.Random, *, text: bool, depth: int = 3) -> str:
    """Return an expression with a bracket around whatever is compound, mostly of the kind that is asked for."""
    if chance.random() < 0.01:
        text = not text
    if depth == 0 or chance.random() < 0.3:
        return chance.choice((*TEXTS[:3], *TEXTUAL) if text else (*NUMBERS[:8], *NUMERIC, "true", "false", chance.choice(NUMBERS)))

    def inner(*, text: bool) -> str:
        return f"({random_expression(chance, text=text, depth=depth - 1)})"

    form = chance.randrange(10)
    if form == 0:
        condition = inner(text=chance.random() < 0.05)
        return f"{condition} ? {inner(text=text)} : {inner(text=text)}"
    if form == 1 and depth < 3:
        return f"{chance.choice(TEXTUAL if text else NUMERIC)} {chance.choice((':=', '='))} {inner(text=text)}"
    if text:
        symbol, right = chance.choice((("+", True), ("..", True), ("..", False)))
        return f"{inner(text=True)} {symbol} {inner(text=right)}"
    if form < 4:
        texts = chance.random() < 0.3
        pairs = zip(chance.choices(("==", "!=", "<", ">", "<=", ">="), k=chance.choice((1, 1, 2))), (1, 2), strict=False)
        return inner(text=texts) + "".join(f" {symbol} {inner(text=texts and chance.random() < 0.8)}" for symbol, _ in pairs)
    if form == 4:
        # What `~` makes of 0/0 is undefined in C++.
        return chance.choice(("-" + inner(text=False), "!" + inner(text=False), "~" + chance.choice((*NUMBERS[:8], *NUMERIC))))
    symbol = chance.choice(("+", "-", "*", "/", "&", "|", "^", "&&", "||"))
    if symbol in {"&&", "||"}:
        return f"(!{inner(text=False)}) {symbol} ({inner(text=False)} < {inner(text=False)})"
    return f"{inner(text=False)} {symbol} {inner(text=False)}"


def random_script(chance: random.Random) -> str:
    """Return entries with a first value, and assignments of random expressions to them."""
    first = [f"{name} := {chance.choice(NUMBERS[:7])}" for name in NUMERIC] + [f"{name} := {chance.choice(TEXTS)}" for name in TEXTUAL]
    statements = [statement for statement in first if chance.random() < 0.98]
    for _ in range(chance.randrange(1, 4)):
        text = chance.random() < 0.3
        name = chance.choice((*(TEXTUAL if text else NUMERIC), f"new{len(statements)}"))
        symbol = ":=" if name.startswith("new") else chance.choice((":=", "=", "+=") if text else (":=", "=", "+=", "-=", "*=", "/="))
        statements.append(f"{name} {symbol} ({random_expression(chance, text=text)})")
    return "; ".join(statements)


def random_words(chance: random.Random) -> str:
    """Return words in any order: most are no script."""
    count = chance.randrange(1, 9)
    return "a := " + chance.choice(("", " ")).join(chance.choice(WORDS) for _ in range(count))
