"""A resource, in either notation: `state`, `initial` and the transitions, in any order.

The paper's: `initial S  A -> B  extern B -> C`. The Robot Language's: `state { A B C } initial A transition { A -> B } | all`.
In both: `silence 2 s`.
"""

from __future__ import annotations

from collections.abc import Callable

from alula.language.lexer import Kind, Token
from alula.language.syntax.cursor import Cursor
from alula.language.syntax.quantities import setting
from alula.model.model import Resource, Transition

MAX_STATES = 250
"""`transition all` of so many states has 62,500 transitions; state machines of people have a dozen states."""

MAX_TRANSITIONS = 130_000
"""In a file: two such resources."""

_WORDS = frozenset({"initial", "transition", "state", "extern", "silence"})


def read_resource(cursor: Cursor, outer: Callable[[], bool]) -> Resource:
    """Read `name { ... }`; ``outer`` as in ``Cursor.block``."""
    name = cursor.name("the name of the resource")
    reader = _ResourceReader(cursor, outer)
    cursor.block(reader.member, outer)
    return reader.build(name)


class _ResourceReader:
    """Reads the body of one resource.

    States are those of `state { A B }` where it is given, else those that occur, the initial one first.
    """

    def __init__(self, cursor: Cursor, outer: Callable[[], bool]) -> None:
        self.cursor = cursor
        self.outer = outer
        self.states: list[str] | None = None
        self.initial = ""
        self.transitions: list[Transition] = []
        self.all = False
        self.extern_all = False
        self.silence_s: float | None = None

    def member(self) -> None:
        """Read one line of the body."""
        cursor = self.cursor
        if cursor.at_word("state") and cursor.ahead().kind is not Kind.END:
            self._states()
        elif cursor.at_word("transition") and (cursor.ahead().text in {"{", "all", "extern"} or cursor.ahead(2).text == "->"):
            cursor.advance()
            if cursor.at("{"):
                cursor.block(self._transition, self.outer)
            else:
                self._transition()
        elif cursor.at_word("initial"):
            self._initial()
        elif cursor.at("silence") and (cursor.ahead().kind is Kind.NUMBER or cursor.ahead().text in {"=", ":"}):
            self._silence()
        elif cursor.at_word("transition"):
            raise self._fail_transition()
        else:
            self._transition()

    def build(self, name: Token) -> Resource:
        """Return the resource; too many states or transitions are reported, and cut."""
        transitions = tuple(self.transitions)
        states = tuple(self.states) if self.states is not None else occurring(self.initial, transitions)
        source = self.cursor.source
        source.transitions += len(transitions) + (self.all + self.extern_all) * len(states) ** 2
        if len(states) > MAX_STATES or source.transitions > MAX_TRANSITIONS:
            message = f"resource `{name.text}` has {len(states)} states; there may be {MAX_STATES}"
            if len(states) <= MAX_STATES:
                message = f"with resource `{name.text}` the file has {source.transitions} transitions; there may be {MAX_TRANSITIONS}"
            hint = "numbers are data, not states: let the functional layer publish them"
            source.report("ALU109", message, self.cursor.span(name), hint=hint)
            return Resource(name.text, states[:MAX_STATES], self.initial, (), span=self.cursor.span(name))
        if self.extern_all:
            transitions += _missing(every_transition(states, extern=True), transitions)
        if self.all:
            transitions += _missing(every_transition(states), transitions)
        if self.silence_s is not None:
            transitions = with_silence(transitions, states, self.initial)
        return Resource(name.text, states, self.initial, transitions, self.all, self.silence_s, span=self.cursor.span(name))

    def _states(self) -> None:
        cursor = self.cursor
        word = cursor.advance()
        if self.states is not None:
            cursor.source.report("ALU106", "`state` is given twice in this resource", cursor.span(word))
        states: list[str] = []
        self.states = states
        if cursor.at("{"):
            cursor.block(lambda: states.append(cursor.name("a state").text), self.outer)
            return
        states.append(cursor.name("a state").text)
        while cursor.here.kind is Kind.NAME and cursor.here.text not in _WORDS and cursor.ahead().text != "->":
            states.append(cursor.name("a state").text)

    def _initial(self) -> None:
        word = self.cursor.advance()
        if self.initial:
            self.cursor.source.report("ALU106", "`initial` is given twice in this resource", self.cursor.span(word))
        self.cursor.accept("=", ":")
        self.initial = self.cursor.name("a state").text

    def _silence(self) -> None:
        word = self.cursor.here
        if self.silence_s is not None:
            self.cursor.source.report("ALU106", "`silence` is given twice in this resource", self.cursor.span(word))
        self.silence_s = setting(self.cursor, "silence")

    def _transition(self) -> None:
        """Read `A -> B`, `extern A -> B`, `all` or `extern all`."""
        extern = self.cursor.at_word("extern") and self.cursor.accept("extern") is not None
        if self.cursor.at_word("all"):
            self.cursor.advance()
            self.all |= not extern
            self.extern_all |= extern
        else:
            self._from_to(extern=extern)

    def _from_to(self, *, extern: bool) -> None:
        if self.cursor.here.kind is not Kind.NAME:
            raise self.cursor.fail("a state", "`initial`", "`extern`", "`}`")
        source = self.cursor.name("a state")
        self.cursor.expect("->", hint="a transition is written `A -> B` or `extern A -> B`")
        target = self.cursor.name("a state")
        self.transitions.append(Transition(source.text, target.text, extern, span=self.cursor.span(source, target)))

    def _fail_transition(self) -> Exception:
        self.cursor.advance()
        return self.cursor.fail("`{`", "`all`", hint="write `transition { A -> B }`, or `transition all` to allow every one")


def occurring(initial: str, transitions: tuple[Transition, ...]) -> tuple[str, ...]:
    """Return the states that occur, the initial one first, then in the order of the transitions."""
    names = [initial] if initial else []
    for transition in transitions:
        names += [transition.source, transition.target]
    return tuple(dict.fromkeys(names))


def _missing(wanted: tuple[Transition, ...], given: tuple[Transition, ...]) -> tuple[Transition, ...]:
    known = set(given)
    return tuple(transition for transition in wanted if transition not in known)


def is_of_silence(transition: Transition, initial: str) -> bool:
    """Return whether `silence` in a resource with this initial state stands for the transition."""
    return transition.extern and transition.target == initial


def with_silence(transitions: tuple[Transition, ...], states: tuple[str, ...], initial: str) -> tuple[Transition, ...]:
    """Return the transitions with those that `silence` stands for at the end: from each state back to the initial one."""
    back = tuple(Transition(state, initial, extern=True) for state in states if state != initial and initial in states)
    return (*(transition for transition in transitions if not is_of_silence(transition, initial)), *back)


def every_transition(states: tuple[str, ...], *, extern: bool = False) -> tuple[Transition, ...]:
    """Return what `transition all` (or `extern all`) stands for.

    Skills may take the resource from each state to each, to the one that it is in as well: nothing is wrong with an effect that
    finds it there. The functional layer reports changes, and from a state to itself there is none.
    """
    pairs = ((source, target) for source in states for target in states if source != target or not extern)
    return tuple(Transition(source, target, extern) for source, target in pairs)
