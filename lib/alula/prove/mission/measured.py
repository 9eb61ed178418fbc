"""Data that a mission's conditions ask: of each value as much as they can tell apart, which may be otherwise at every tick.

    ("data", "rover.battery", "fresh", "")                 # is there a value that is not stale?
    ("data", "rover.battery.volts", "number", "")          # was a number measured?
    ("data", "rover.battery.level", "<", "0.15")           # questions of a tick; their answers fit together

All that is asked in one tick is asked of one value: each answer narrows down where it is, so that only what is open is a choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from alula.model.model import Skillset
from alula.prove.mission.oracle import Asked, Oracle, UndecidedError
from alula.prove.mission.unknown import Distance, UnknownNumber, UnknownText
from alula.trees.access import scripts_of
from alula.trees.document import Attribute, Element
from alula.trees.node import NodeConfig
from alula.trees.script import statements_of
from alula.trees.script.compiler import EPSILON
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Conditional, Literal, Name, Node, Prefix, children

if TYPE_CHECKING:
    from typing import Self  # of Python 3.11

DATA, FRESH, NUMBER = "data", "fresh", "number"
LOGIC = frozenset({"&&", "||"})


class Kind(Enum):
    """How the conditions use the value of a name; one that stands alone is true or false."""

    NUMBER = "number"
    FLAG = "flag"
    TEXT = "text"


@dataclass(frozen=True)
class Conditions:
    """What conditions ask of data: ``kinds`` by whole names (``rover.battery.level``), and the data of which ``fresh`` is asked."""

    kinds: Mapping[str, Kind] = field(default_factory=dict)
    fresh: frozenset[str] = frozenset()

    @classmethod
    def of(cls, roots: Iterable[NodeConfig], skillsets: Iterable[Skillset]) -> Conditions:
        """Collect the conditions of a mission's trees; raises UndecidedError for scripts that compute with data, or copy them."""
        types = {f"{one.name}.{data.name}": data.type for one in skillsets for data in one.data}
        asking = _Asking(types)
        for config in (config for root in roots for config in root.walk()):
            for attribute in scripts_of(config.element, config.type):
                asking.script(config.element, attribute)
        return cls(asking.kinds, frozenset(asking.fresh))


def data_in(name: str) -> str:
    """Return ``skillset.data`` of a name of it or of one of its fields."""
    return ".".join(name.split(".", 2)[:2])


class _Asking:
    """Collects what scripts ask of data."""

    def __init__(self, types: Mapping[str, str]) -> None:
        self.kinds: dict[str, Kind] = {}
        self.fresh: set[str] = set()
        self._types = types
        self._place = ""

    def script(self, element: Element, attribute: Attribute) -> None:
        self._place = f"line {element.place.line}, `{attribute.value}`"
        for statement in statements_of(attribute.value):
            self._look(statement, asked=attribute.value != element.get("otherwise"))

    def _look(self, node: Node, *, asked: bool) -> None:
        """Look at a part of a script, of whose value no more is ``asked`` than whether it is true, or which goes on as it is."""
        match node:
            case Name() if self._is_data(node):
                if not asked:
                    raise UndecidedError(f"{self._place}: computes with the data {node.name}")
                self._told(node.name, Kind.FLAG)
            case Comparison():
                self._compared(node)
            case Call():
                self.fresh.update(name for name in node.named if name in self._types and node.function == FRESH)
            case Conditional():
                self._look(node.condition, asked=True)
                self._look(node.then, asked=asked)
                self._look(node.otherwise, asked=asked)
            case Assignment():
                self._look(node.value, asked=False)
            case _:
                logic = (isinstance(node, Chain) and LOGIC.issuperset(node.operators)) or (
                    isinstance(node, Prefix) and node.operator == "!"
                )
                for child in children(node):
                    self._look(child, asked=logic)

    def _compared(self, node: Comparison) -> None:
        several = [one for one in node.operands if isinstance(one, Name) and self._is_data(one)]
        if len(several) > 1:
            raise UndecidedError(f"{self._place}: compares the data {several[0].name} with the data {several[1].name}")
        for one in node.operands:
            if one not in several:
                self._look(one, asked=False)
        text = any(isinstance(one, Literal) and isinstance(one.value, str) for one in node.operands)
        for name in several:
            self._told(name.name, Kind.TEXT if text or self._types.get(name.name) == "string" else Kind.NUMBER)

    def _told(self, name: str, kind: Kind) -> None:
        declared = self._types.get(name, "")
        if declared == "bool":
            kind = Kind.FLAG
        elif kind is Kind.FLAG and declared:
            raise UndecidedError(f"{self._place}: the data {name} is neither true nor false, but a {declared}")
        if self.kinds.setdefault(name, kind) is not kind:
            raise UndecidedError(f"{self._place}: the data {name} is asked as a {kind.value}, and as a {self.kinds[name].value} elsewhere")

    def _is_data(self, node: Name) -> bool:
        return data_in(node.name) in self._types


# --- in a tick ---------------------------------------------------------------------------------------------------------


class Measurements:
    """The data as one tick reads them."""

    def __init__(self, oracle: Oracle, conditions: Conditions) -> None:
        self._oracle = oracle
        self._conditions = conditions
        self._known: dict[str, object] = {}

    def begin(self) -> None:
        """Begin another tick: each value may have changed."""
        self._known = {}

    @property
    def any(self) -> bool:
        """Return whether this tick has read any."""
        return bool(self._known)

    def value(self, data: str) -> object | None:
        """Return a value of ``skillset.data``, or an object that has its fields; None where there is no fresh one."""
        if data not in self._known:
            self._known[data] = self._oracle.choose((DATA, data, FRESH, ""))
        return self.part(data) if self._known[data] else None

    def part(self, name: str) -> object:
        """Return the value of a field, or an object that has its fields; NaN where no number was measured."""
        if name not in self._conditions.kinds:
            return _Fields(self, name)
        key = f"{name} "  # a data without fields has its freshness by its name
        if key not in self._known:
            self._known[key] = self._made(name)
        return self._known[key]

    def _made(self, name: str) -> object:
        match self._conditions.kinds[name]:
            case Kind.TEXT:
                return MeasuredText(self._oracle, name)
            case Kind.FLAG:
                return MeasuredNumber(self._oracle, name, 0.0, 1.0)
        data = data_in(name)
        of_data = [one for one in self._conditions.kinds if data_in(one) == data]
        apart = data in self._conditions.fresh or len(of_data) > 1  # from a stale value
        if apart and not self._oracle.choose((DATA, name, NUMBER, "")):
            return math.nan
        return MeasuredNumber(self._oracle, name)


class _Fields:
    """A value with fields."""

    def __init__(self, measurements: Measurements, name: str) -> None:
        self._measurements = measurements
        self._name = name

    def __getattr__(self, name: str) -> object:
        return self._measurements.part(f"{self._name}.{name}")


class MeasuredNumber(UnknownNumber):
    """A number that was measured; each answer about it bounds it for the rest of the tick."""

    __slots__ = ()

    def __new__(cls, oracle: Oracle, what: str, low: float = -math.inf, high: float = math.inf) -> Self:
        """Make one. As a plain float it is no NaN: that would mean that nothing was measured."""
        made = float.__new__(cls, math.inf)
        made.oracle, made.what, made.low, made.high, made.whole, made.others = oracle, what, low, high, False, frozenset()
        return made

    @property
    def keeps_answers(self) -> bool:
        """Return True: a test for NaN is a question of its own."""
        return True

    def _asked(self, symbol: str, other: float) -> bool:
        if isinstance(other, UnknownNumber):
            raise UndecidedError(f"the data {self.what} is compared with {other.what}, which is not known either")
        return bool(self.oracle.choose((DATA, self.what, symbol, repr(other))))

    def near(self, other: float) -> bool:
        """Return whether it is equal to another, as scripts count."""
        if isinstance(other, UnknownNumber):
            raise UndecidedError(f"the data {self.what} is compared with {other.what}, which is not known either")
        low, high = other - EPSILON, other + EPSILON
        if low <= self.low and self.high <= high:
            return True
        if self.high < low or self.low > high:
            return False
        if self.oracle.choose((DATA, self.what, "==", repr(float(other)))):
            self.low, self.high = max(self.low, low), min(self.high, high)
            return True
        if self.low >= low or (self.high > high and not self < other):
            self.low = max(self.low, math.nextafter(high, math.inf))
        else:
            self.high = min(self.high, math.nextafter(low, -math.inf))
        return False

    def __eq__(self, other: object) -> bool:
        return isinstance(other, int | float) and self.near(other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = float.__hash__

    def __sub__(self, other: object) -> Distance:  # type: ignore[override]  # scripts compare so; what computes is refused before
        return Distance(lambda: self == other)

    __rsub__ = __sub__  # type: ignore[assignment]


class MeasuredText(UnknownText):
    """A text from outside; each answer about it holds for the rest of the tick."""

    __slots__ = ()

    def _asked(self, symbol: str, other: str) -> bool:
        if symbol != "==" or not other.startswith("'"):
            raise UndecidedError(f"the letters of the data {self.what} are needed")
        return bool(self.oracle.choose((DATA, self.what, symbol, other)))


def of_data(choices: Iterable[Asked]) -> list[Asked]:
    """Return the choices of a tick that are about data."""
    return [one for one in choices if one.question[0] == DATA]
