"""What scripts of a mission may name besides the blackboard: resources, data, executions, failures."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from alula.missions.context import MissionContext
from alula.missions.skills import SkillNode
from alula.missions.skillset import Client
from alula.model.conditions import value_in
from alula.model.model import Skillset
from alula.trees.reading import TreeFiles
from alula.trees.script.scope import Unknown

NOT_HEARD = -1.0
"""No state's number."""


class MissionEnvironment:
    """``navigation.flight_status`` is a resource's state, ``navigation.guidance_state.obstacle_m`` a field of data, in SI units.

    Data without a fresh value are unknown, as in a model's conditions, and ``fresh(D)`` tells whether they are not; ``running(S)``,
    ``progress(S)`` ask for executions that the tree has of a skill. ``failed(NAME)`` tells whether a skill ended so (a result, a
    precondition, an invariant), ``failed_first(S)`` whether S was the first that failed. ``reason(R)`` is what is known of the state of
    a resource, to be put behind a sentence.
    """

    def __init__(self, clients: Mapping[str, Client], context: MissionContext, resources: frozenset[str], data: frozenset[str]) -> None:
        self._clients = clients
        self._resources = resources
        self._data = data
        self.context = context
        self.leaves: dict[str, list[SkillNode]] = {}

    def value(self, name: str) -> object:
        """Return the state of a resource (NOT_HEARD before it was heard of), or a value of data; None where the models have neither."""
        if name in self._resources:
            skillset, _, resource = name.partition(".")
            return self._clients[skillset].resources.get(resource, NOT_HEARD)
        data = ".".join(name.split(".", 2)[:2])
        return self._measured(data, name) if data in self._data else None

    def fresh(self, data: str) -> bool:
        """Return whether a data has a value that is not stale; raises ValueError where there is no such data."""
        if data not in self._data:
            msg = f"there is no data {data}"
            raise ValueError(msg)
        skillset, _, one = data.partition(".")
        return self._clients[skillset].value(one) is not None

    def _measured(self, data: str, name: str) -> object:
        skillset, _, one = data.partition(".")
        known = self._clients[skillset].value(one)
        if known is None:
            return Unknown(f"{data} has no fresh value")
        value = value_in(known, name.split(".")[2:])
        return value if isinstance(value, bool | int | float | str) else Unknown(f"{name} is not in what was received, or not a number")

    def call(self, name: str, arguments: Sequence[object]) -> object:
        """Ask; raises KeyError and ValueError."""
        function = FUNCTIONS[name]
        if len(arguments) != 1:
            msg = f"{name}(...) takes one name"
            raise ValueError(msg)
        return function.ask(self, str(arguments[0]))

    def because(self, resource: str) -> str:
        """Return why a resource is in its state, to be put behind a sentence; empty where nothing was told."""
        skillset, _, name = resource.partition(".")
        reason = self._clients[skillset].reasons.get(name, "") if skillset in self._clients else ""
        return f": {reason}" if reason else ""

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
    ask: Callable[[MissionEnvironment, str], object]


FUNCTIONS: Mapping[str, Function] = {
    "running": Function("skill", lambda env, skill: any(leaf.running for leaf in env.of(skill))),
    "progress": Function("skill", lambda env, skill: max((leaf.progress for leaf in env.of(skill)), default=0.0)),
    "fresh": Function("data", lambda env, data: env.fresh(data)),
    "failed_first": Function("skill", lambda env, skill: bool(env.context.failures) and env.context.failures[0].skill == skill),
    "failed": Function("end", lambda env, end: any(failure.result == end for failure in env.context.failures)),
    "reason": Function("resource", lambda env, resource: env.because(resource)),
}


def states_of(skillsets: Iterable[Skillset]) -> dict[str, float]:
    """Return a number for each name of a state, so that scripts may name it without quotes."""
    names = dict.fromkeys(state for skillset in skillsets for resource in skillset.resources for state in resource.states)
    return {name: float(number) for number, name in enumerate(names)}


def asked_data(files: TreeFiles, skillsets: Iterable[Skillset]) -> dict[str, frozenset[str]]:
    """Return the data that a mission's scripts ask for, by skillset."""
    words: set[str] = set()
    elements = list(files.trees.values())
    while elements:
        element = elements.pop()
        elements += element.children
        for attribute in element.attributes.values():
            words.update(re.findall(r"[A-Za-z_]\w*\.[A-Za-z_]\w*", attribute.value))
    return {one.name: frozenset(data for data in one.data_index if f"{one.name}.{data}" in words) for one in skillsets}
