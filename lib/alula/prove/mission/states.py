"""States of resources as a mission's scripts see them: no more is asked of one than whether it is the state that it is compared with.

    ("state", "navigation", "flight_status", "IN_AIR")     # a question of a tick: is it this state?

So ticks that a script can't tell apart are one tick. Of a resource that a script uses otherwise its state itself is asked.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from alula.missions.environment import states_of
from alula.model.model import Skillset
from alula.prove.mission.oracle import Oracle
from alula.prove.mission.unknown import Distance
from alula.trees.access import Accesses, takes_script_from_entry
from alula.trees.node import NodeConfig
from alula.trees.script import statements_of
from alula.trees.script.syntax import Comparison, Name

if TYPE_CHECKING:
    from typing import Self  # of Python 3.11

STATE = "state"
EQUAL = frozenset({"==", "!="})


@dataclass(frozen=True)
class Compared:
    """The resources (``skillset.resource``) that scripts only compare with states; ``states``: their names by scripts' numbers."""

    resources: frozenset[str] = frozenset()
    states: Mapping[float, str] = field(default_factory=dict)

    @classmethod
    def of(cls, roots: Iterable[NodeConfig], skillsets: Iterable[Skillset]) -> Compared:
        """Read those of a mission's trees; none where a script comes from the blackboard, for then anything may be asked."""
        several = list(skillsets)
        states = {f"{one.name}.{resource.name}": frozenset(resource.states) for one in several for resource in one.resources}
        nodes = [config for root in roots for config in root.walk()]
        if any(takes_script_from_entry(one.element, one.type) for one in nodes):
            return cls()
        accesses = Accesses(lambda script: statements_of(script.value), None)
        named: Counter[str] = Counter(one.type.name for one in nodes)
        compared: Counter[str] = Counter()
        for config in nodes:
            named.update(one.name for one in accesses.in_scripts(config))
            compared.update(name for one in accesses.parts(config) if isinstance(one, Comparison) for name in _compared(one, states))
        numbers = {number: name for name, number in states_of(several).items()}
        return cls(frozenset(name for name in states if named[name] == compared[name]), numbers)


def _compared(node: Comparison, states: Mapping[str, frozenset[str]]) -> Iterator[str]:
    """Yield the resource that a comparison asks for one of its states."""
    if len(node.operands) == len(EQUAL) and EQUAL.issuperset(node.operators) and all(isinstance(one, Name) for one in node.operands):
        left, right = (one.name for one in node.operands if isinstance(one, Name))
        yield from (name for name, state in ((left, right), (right, left)) if state in states.get(name, ()))


class SeenState(float):
    """The number of a state of which a tick asks only whether it is one that a script compares it with; none without managers."""

    __slots__ = ("compared", "oracle", "resource")
    oracle: Oracle
    compared: Compared
    resource: tuple[str, str]

    def __new__(cls, oracle: Oracle, compared: Compared, skillset: str, name: str) -> Self:
        """Make one."""
        made = super().__new__(cls, float("inf"))
        made.oracle, made.compared, made.resource = oracle, compared, (skillset, name)
        return made

    def __sub__(self, other: object) -> Distance:  # type: ignore[override]  # scripts compare so, and do nothing else with it
        states = self.compared.states[other]  # type: ignore[index]  # a number of one
        return Distance(lambda: bool(self.oracle.look((STATE, *self.resource, states))))

    __rsub__ = __sub__  # type: ignore[assignment]
