"""What scripts of a mission may name besides the blackboard: resources, executions, failures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

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

    def __init__(self, clients: Mapping[str, Client], memory: Blackboard) -> None:
        self._clients = clients
        self._memory = memory
        self.leaves: dict[str, list[SkillNode]] = {}
        self._functions: Mapping[str, Callable[[str], object]] = {
            "running": lambda skill: any(leaf.running for leaf in self._of(skill)),
            "progress": lambda skill: max((leaf.progress for leaf in self._of(skill)), default=0.0),
            "failed": lambda name: any(failure.result == name for failure in memory.failures),
            "failed_first": lambda skill: bool(memory.failures) and memory.failures[0].skill == skill,
            "reason": memory.because,
        }

    def value(self, name: str) -> object:
        """Return the state of a resource, NOT_HEARD when it was not heard of yet; None where there is no such skillset."""
        skillset, _, resource = name.partition(".")
        client = self._clients.get(skillset)
        return None if client is None else client.resources.get(resource, NOT_HEARD)

    def call(self, name: str, arguments: Sequence[object]) -> object:
        """Ask; raises KeyError and ValueError."""
        function = self._functions[name]
        if len(arguments) != 1:
            msg = f"{name}(...) takes one name"
            raise ValueError(msg)
        return function(str(arguments[0]))

    def _of(self, skill: str) -> Iterable[SkillNode]:
        if skill not in self.leaves:
            msg = f"the tree has no leaf {skill}"
            raise ValueError(msg)
        return self.leaves[skill]


def states_of(skillsets: Iterable[Skillset]) -> dict[str, float]:
    """Return a number for each name of a state, so that scripts may name it without quotes."""
    names = dict.fromkeys(state for skillset in skillsets for resource in skillset.resources for state in resource.states)
    return {name: float(number) for number, name in enumerate(names)}
