"""Decide which states of resources are alarms, by the robot's models and its file of faults, never by a state's name.

A state is an alarm that the functional layer reports, and that a fault of the robot shows (``faults.yaml``) or that breaks an invariant
of a skill, whatever the other resources are. In the state in which a resource begins, nothing has gone wrong yet, and a skill whose
invariant it breaks may be one that nobody needs, as charging away from the dock: it is an alarm only while the robot is away, and only
where a fault shows it. Where no file tells what faults show, the invariants alone decide.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from fnmatch import fnmatchcase

from alula.model.conditions import NO_DATA, judge
from alula.model.expressions import Expression, ResourceIs, atoms
from alula.model.model import Resource, Skillset

ANY = "*"
"""In a file of faults: any state; it makes none of them an alarm."""


class Alarm(Enum):
    """How bad the news are; the values are for the page and for files."""

    NONE = ""
    AWAY = "away"
    ALWAYS = "always"


@dataclass(frozen=True)
class Alarms:
    """The alarms of a robot, each ``skillset.resource STATE``: those that always are, and those that are while the robot is away."""

    always: frozenset[str] = field(default_factory=frozenset)
    away: frozenset[str] = field(default_factory=frozenset)

    def of(self, resource: str, state: str) -> Alarm:
        """Return what it means that a resource, ``skillset.resource``, has come into a state."""
        said = f"{resource} {state}"
        return Alarm.ALWAYS if said in self.always else Alarm.AWAY if said in self.away else Alarm.NONE

    def named(self, name: Callable[[str], str]) -> Alarms:
        """Return them for skillsets that are called otherwise: ``name`` makes what begins with such a name of what begins with one here."""
        return Alarms(frozenset(map(name, self.always)), frozenset(map(name, self.away)))


def alarms_of(skillsets: Iterable[Skillset], shown: Iterable[str] | None = None) -> Alarms:
    """Return the alarms of models; ``shown`` are patterns of what faults show, ``skillset.resource STATE``; None: they are not known."""
    patterns = [pattern for pattern in shown or () if not pattern.endswith(f" {ANY}")]
    always: set[str] = set()
    away: set[str] = set()
    for skillset in skillsets:
        breaking = set(breaking_states(skillset))
        for resource, state in _reported(skillset):
            said = f"{skillset.name}.{resource.name} {state}"
            by_fault = any(fnmatchcase(said, pattern) for pattern in patterns)
            if state != resource.initial and (by_fault or said in breaking):
                always.add(said)
            elif by_fault or (shown is None and said in breaking):
                away.add(said)
    return Alarms(frozenset(always), frozenset(away))


def breaking_states(skillset: Skillset) -> Iterator[str]:
    """Yield the states, ``skillset.resource STATE``, that the functional layer reports and that break an invariant by themselves."""
    conditions = [invariant.condition for skill in skillset.skills for invariant in skill.invariants]
    for resource, state in _reported(skillset):
        if any(_breaks(resource, state, condition, skillset) for condition in conditions):
            yield f"{skillset.name}.{resource.name} {state}"


def _reported(skillset: Skillset) -> Iterator[tuple[Resource, str]]:
    for resource in skillset.resources:
        targets = dict.fromkeys(transition.target for transition in resource.transitions if transition.extern)
        yield from ((resource, state) for state in targets)


@functools.cache
def _breaks(resource: Resource, state: str, condition: Expression, skillset: Skillset) -> bool:
    """Return whether a condition is false with this state of a resource, whatever the others are."""
    asked = dict.fromkeys(atom.resource for atom in atoms(condition) if isinstance(atom, ResourceIs))
    if resource.name not in asked:
        return False
    others = [one for one in skillset.resources if one.name in asked and one.name != resource.name]
    names = [resource.name, *(one.name for one in others)]
    combinations = itertools.product((state,), *(one.states for one in others))
    return all(judge(condition, dict(zip(names, states, strict=True)), NO_DATA) is False for states in combinations)
