"""Random trees as XML, and the answers of their leaves: all control nodes and decorators, subtrees, scripts, conditions."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.sax.saxutils import quoteattr

DEEPEST = 6
VARIABLES = ("a", "b", "c")
NEVER_MS = 10_000_000
"""BehaviorTree.CPP's clock is the wall's: what takes time never ends in these trees; other tests move the clock."""


def script(rng: random.Random) -> str:
    """Return a script that writes."""
    name, other = rng.choice(VARIABLES), rng.choice(VARIABLES)
    return rng.choice(
        [
            f"{name} := {rng.randint(0, 3)}",
            f"{name} += 1",
            f"{name} = {other}",
            f"{name} = ({other} + 1) * {rng.randint(1, 2)}",
            f"{name} := {other}; {other} -= 1",
            f"{name} := {other} &gt; 2 ? 0 : {other}",
        ]
    ).replace("&gt;", ">")


def condition(rng: random.Random) -> str:
    """Return a script that asks."""
    name, other, number = rng.choice(VARIABLES), rng.choice(VARIABLES), rng.randint(0, 3)
    return rng.choice(
        [
            f"{name} == {number}",
            f"{name} > {number}",
            f"{name} != {other}",
            f"{name} < {number} || {other} > 1",
            "true",
            "false",
            f"!({name} == {other})",
        ]
    )


@dataclass
class Maker:
    """Makes one file; ``answers`` of its leaves by name, taken in turn and from the beginning again."""

    rng: random.Random
    answers: dict[str, list[str]] = field(default_factory=dict)
    trees: list[str] = field(default_factory=list)
    _leaves: int = 0
    _texts: dict[str, str] = field(default_factory=dict)

    def file(self) -> str:
        """Return the text of a file whose tree is ``main``."""
        for number in range(self.rng.choice([0, 0, 1, 2])):
            depth = self.rng.randint(1, 3)
            self.trees.append(f"sub{number}")
            self._body(self.trees[-1], depth, self.trees[:-1])
        subtrees, self.trees = self.trees, []
        texts = [self._texts[name] for name in subtrees]
        begin = "a := 0; b := 1; c := 2"
        main = self.node(self.rng.randint(1, DEEPEST - 1), subtrees)
        texts.append(f'<BehaviorTree ID="main"><Sequence><RunOnce><Script code="{begin}"/></RunOnce>{main}</Sequence></BehaviorTree>')
        return f'<root BTCPP_format="4" main_tree_to_execute="main">{"".join(texts)}</root>'

    def _body(self, name: str, depth: int, subtrees: list[str]) -> None:
        begin = "a := 0; b := 1; c := 2" if self.rng.random() < 0.7 else "a := 2; b := 2; c := 2"
        inner = self.node(depth, subtrees)
        self._texts[name] = f'<BehaviorTree ID="{name}"><Sequence><Script code="{begin}"/>{inner}</Sequence></BehaviorTree>'

    # --- nodes -----------------------------------------------------------------------------------------------------------

    def node(self, depth: int, subtrees: list[str]) -> str:
        """Return a node with all below it."""
        if depth <= 0 or self.rng.random() < 0.2:
            return self._leaf(subtrees)
        kind = self.rng.choice(KINDS)
        return kind(self, depth - 1, subtrees)

    def children(self, count: int, depth: int, subtrees: list[str]) -> str:
        return "".join(self.node(depth, subtrees) for _ in range(count))

    def conditions(self) -> str:
        """Return attributes that stand before and after a node."""
        rng, parts = self.rng, []
        if rng.random() < 0.2:
            parts.append((rng.choice(["_skipIf", "_successIf", "_failureIf", "_while"]), condition(rng)))
            if rng.random() < 0.2:
                parts.append((rng.choice(["_skipIf", "_successIf", "_failureIf", "_while"]), condition(rng)))
        if rng.random() < 0.2:
            name = rng.choice(["_onSuccess", "_onFailure", "_onHalted", "_post"])
            # A script that fails while BehaviorTree.CPP takes a tree down ends its process, so this one can't fail.
            parts.append((name, f"{rng.choice(VARIABLES)} := {rng.randint(0, 3)}" if name == "_onHalted" else script(rng)))
        return "".join(f" {name}={quoteattr(text)}" for name, text in dict(parts).items())

    def element(self, tag: str, content: str, **ports: object) -> str:
        given = "".join(f" {name}={quoteattr(str(value))}" for name, value in ports.items())
        return f"<{tag}{given}{self.conditions()}>{content}</{tag}>"

    def _leaf(self, subtrees: list[str]) -> str:
        rng, roll = self.rng, self.rng.random()
        if subtrees and roll < 0.15:
            return self._subtree(rng.choice(subtrees))
        if roll < 0.6:
            return self._own("Act")
        if roll < 0.75:
            return self._own("Ask")
        tag, ports = rng.choice(LEAVES)
        return self.element(tag, "", **ports(rng))

    def _own(self, tag: str) -> str:
        self._leaves += 1
        name, rng = f"{tag.lower()}{self._leaves}", self.rng
        kinds = ["SUCCESS", "FAILURE"] if tag == "Ask" else ["SUCCESS", "SUCCESS", "FAILURE", "RUNNING", "RUNNING", "SKIPPED"]
        weights = None if rng.random() < 0.7 else [rng.random() for _ in kinds]
        self.answers[name] = rng.choices(kinds, weights, k=rng.randint(1, 5))
        return self.element(tag, "", name=name)

    def _subtree(self, name: str) -> str:
        rng = self.rng
        ports: dict[str, str] = {}
        if rng.random() < 0.3:
            ports["_autoremap"] = "true"
        for variable in VARIABLES:
            roll = rng.random()
            if roll < 0.3:
                ports[variable] = "{" + rng.choice(["a", "b", "c", "="]) + "}"
        return self.element("SubTree", "", ID=name, **ports)


Kind = Callable[[Maker, int, list[str]], str]


def _control(tag: str, least: int = 1, most: int = 4) -> Kind:
    return lambda maker, depth, subtrees: maker.element(tag, maker.children(maker.rng.randint(least, most), depth, subtrees))


def _parallel(maker: Maker, depth: int, subtrees: list[str]) -> str:
    rng, count = maker.rng, maker.rng.randint(1, 4)
    ports: dict[str, object] = {}
    if rng.random() < 0.7:
        ports["success_count"] = rng.randint(-2, count)
    if rng.random() < 0.7:
        ports["failure_count"] = rng.randint(-2, count)
    return maker.element("Parallel", maker.children(count, depth, subtrees), **ports)


def _parallel_all(maker: Maker, depth: int, subtrees: list[str]) -> str:
    count = maker.rng.randint(1, 4)
    ports = {"max_failures": maker.rng.randint(-2, count)} if maker.rng.random() < 0.7 else {}
    return maker.element("ParallelAll", maker.children(count, depth, subtrees), **ports)


def _switch(maker: Maker, depth: int, subtrees: list[str]) -> str:
    rng, cases = maker.rng, maker.rng.randint(2, 6)
    ports = {f"case_{number}": rng.randint(0, 3) for number in range(1, cases + 1)}
    return maker.element(f"Switch{cases}", maker.children(cases + 1, depth, subtrees), variable="{" + rng.choice("abc") + "}", **ports)


def _decorator(tag: str, ports: Callable[[random.Random], dict[str, object]] = lambda _: {}) -> Kind:
    return lambda maker, depth, subtrees: maker.element(tag, maker.node(depth, subtrees), **ports(maker.rng))


def _maybe(name: str, *values: object) -> Callable[[random.Random], dict[str, object]]:
    return lambda rng: {name: rng.choice(values)} if rng.random() < 0.7 else {}


def _one(name: str, *values: object) -> Callable[[random.Random], dict[str, object]]:
    return lambda rng: {name: rng.choice(values)}


def _precondition(rng: random.Random) -> dict[str, object]:
    return {"if": condition(rng), **_maybe("else", "SUCCESS", "FAILURE", "SKIPPED", "RUNNING")(rng)}


def _loop(rng: random.Random) -> dict[str, object]:
    items = ";".join(str(rng.randint(0, 3)) for _ in range(rng.randint(1, 3)))
    return {"queue": items, "value": "{" + rng.choice("defg") + "}", **_maybe("if_empty", "SUCCESS", "FAILURE", "SKIPPED")(rng)}


KINDS: tuple[Kind, ...] = (
    *(_control(tag) for tag in ("Sequence", "AsyncSequence", "SequenceWithMemory", "ReactiveSequence")),
    *(_control(tag) for tag in ("Fallback", "AsyncFallback", "ReactiveFallback")),
    _control("IfThenElse", 2, 3),
    _control("WhileDoElse", 2, 3),
    _parallel,
    _parallel,
    _parallel_all,
    _switch,
    *(_decorator(tag) for tag in ("Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure")),
    _decorator("Repeat", _one("num_cycles", 0, 1, 2, 3, -1, -2, "{b}")),
    _decorator("RetryUntilSuccessful", _one("num_attempts", 0, 1, 2, 3, -1, -2, "{c}")),
    _decorator("RunOnce", _maybe("then_skip", "true", "false", "0", "1")),
    _decorator("Precondition", _precondition),
    _decorator("SkipUnlessUpdated", _one("entry", "{a}", "{b}", "c")),
    _decorator("WaitValueUpdate", _one("entry", "{a}", "{b}", "c")),
    _decorator("LoopInt", _loop),
    _decorator("Timeout", _one("msec", 0, NEVER_MS)),
)
LEAVES: tuple[tuple[str, Callable[[random.Random], dict[str, object]]], ...] = (
    ("AlwaysSuccess", lambda _: {}),
    ("AlwaysFailure", lambda _: {}),
    ("Script", lambda rng: {"code": script(rng)}),
    ("ScriptCondition", lambda rng: {"code": condition(rng)}),
    ("SetBlackboard", lambda rng: {"value": rng.choice(["{a}", "{b}"]), "output_key": rng.choice(["d", "e", "@f"])}),
    ("SetBlackboard", lambda rng: {"value": rng.choice(["7", "text"]), "output_key": rng.choice(["s", "t"])}),
    ("UnsetBlackboard", lambda rng: {"key": rng.choice(["d", "e", "s"])}),
    ("WasEntryUpdated", lambda rng: {"entry": "{" + rng.choice("abc") + "}"}),
    ("Sleep", lambda _: {"msec": 0}),
)


def make_case(seed: int) -> tuple[str, dict[str, list[str]], list[int]]:
    """Return a file's text, its leaves' answers, and before which ticks the tree is halted from outside."""
    rng = random.Random(seed)  # noqa: S311
    maker = Maker(rng)
    text = maker.file()
    halts = [rng.randint(1, 8)] if rng.random() < 0.2 else []
    return text, maker.answers, halts
