"""What scripts of a mission may name besides the blackboard: resources, executions, failures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from alula.missions.blackboard import Blackboard
from alula.missions.filed.skills import SkillNode
from alula.missions.skillset import Client
from alula.model.model import Skillset

NOT_HEARD = -1.0
"""No state's number."""


class World:
    """``navigation.flight_status`` is a resource's state; ``running(S)``, ``progress(S)`` ask for executions that the tree has of a skill.

    ``failed(NAME)`` tells whether a skill ended so (a result, a precondition, an invariant), ``failed_first(S)`` whether S was the first
    that failed. ``reason(R)`` is what is known of the state of a resource, to be put behind a sentence.
    """

    def __init__(self, clients: Mapping[str, Client], memory: Blackboard, resources: frozenset[str]) -> None:
        self._clients = clients
        self._resources = resources
        self.memory = memory
        self.leaves: dict[str, list[SkillNode]] = {}

    def value(self, name: str) -> object:
        """Return the state of a resource, NOT_HEARD when it was not heard of yet; None where the models have no such resource."""
        skillset, _, resource = name.partition(".")
        return self._clients[skillset].resources.get(resource, NOT_HEARD) if name in self._resources else None

    def call(self, name: str, arguments: Sequence[object]) -> object:
        """Ask; raises KeyError and ValueError."""
        function = FUNCTIONS[name]
        if len(arguments) != 1:
            msg = f"{name}(...) takes one name"
            raise ValueError(msg)
        return function.ask(self, str(arguments[0]))

    def of(self, skill: str) -> Iterable[SkillNode]:
        """Return the leaves of a skill; raises ValueError where the tree has none."""
        if skill not in self.leaves:
            msg = f"the tree has no leaf {skill}"
            raise ValueError(msg)
        return self.leaves[skill]


@dataclass(frozen=True)
class Function:
    """What scripts may ask: ``kind`` is what its one name is of. An end is a result, a precondition or an invariant."""

    kind: str
    ask: Callable[[World, str], object]


FUNCTIONS: Mapping[str, Function] = {
    "running": Function("skill", lambda world, skill: any(leaf.running for leaf in world.of(skill))),
    "progress": Function("skill", lambda world, skill: max((leaf.progress for leaf in world.of(skill)), default=0.0)),
    "failed_first": Function("skill", lambda world, skill: bool(world.memory.failures) and world.memory.failures[0].skill == skill),
    "failed": Function("end", lambda world, end: any(failure.result == end for failure in world.memory.failures)),
    "reason": Function("resource", lambda world, resource: world.memory.because(resource)),
}


def states_of(skillsets: Iterable[Skillset]) -> dict[str, float]:
    """Return a number for each name of a state, so that scripts may name it without quotes."""
    names = dict.fromkeys(state for skillset in skillsets for resource in skillset.resources for state in resource.states)
    return {name: float(number) for number, name in enumerate(names)}
