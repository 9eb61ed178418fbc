"""The first effects that a fault, or the end of a process, can have on the skill layer: changes of resources and ends of skills."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

from alula.mock import Behaviour
from alula.mock.behaviour import Place
from alula.records.causes.alarms import Alarms
from alula.runtime.core.events import ExecutionEvent, TransitionEvent

EXTERN = "extern"
"""The cause of a change that the functional layer reported."""


@dataclass(frozen=True)
class FaultEffects:
    """Patterns in which ``*`` stands for anything.

    Attributes:
        states: ``skillset.resource STATE`` that report it.
        later: states that the reaction to it can bring about, such as the landing of a failsafe.
        ends: ``skillset.skill END`` of executions that no change of a resource explains: the name of the result or the invariant, else
            the state.
        told: what happened to what the fault is named after, in a word.
    """

    states: frozenset[str] = field(default_factory=frozenset)
    later: frozenset[str] = field(default_factory=frozenset)
    ends: frozenset[str] = field(default_factory=frozenset)
    told: str = "failed"

    def shows(self, change: TransitionEvent) -> bool:
        """Return whether the functional layer can have reported the fault by this change of a resource."""
        return _reported(change) and _any(self.states, f"{change.skillset}.{change.resource} {change.to_state}")

    def leads_to(self, change: TransitionEvent) -> bool:
        """Return whether the change can follow from the reaction to the fault."""
        return _reported(change) and _any(self.later, f"{change.skillset}.{change.resource} {change.to_state}")

    def stops(self, end: ExecutionEvent) -> bool:
        """Return whether an execution can end like this because of the fault."""
        return _any(self.ends, f"{end.skillset}.{end.skill} {end.result or end.state.value}")

    def named(self, name: Callable[[str], str]) -> FaultEffects:
        """Return it for skillsets that are called otherwise: ``name`` makes what begins with such a name of what begins with one here."""
        states, later, ends = (frozenset(name(one) for one in several) for several in (self.states, self.later, self.ends))
        return replace(self, states=states, later=later, ends=ends)


def _reported(change: TransitionEvent) -> bool:
    return change.cause == EXTERN


def _any(patterns: Iterable[str], text: str) -> bool:
    return any(fnmatchcase(text, pattern) for pattern in patterns)


@dataclass(frozen=True)
class EffectsByFault:
    """The effects of a robot's faults, and of the ends of its processes.

    Attributes:
        known: by name, without the way of failing.
        alarms: the states that are bad news, by the robot's models.
    """

    known: Mapping[str, FaultEffects] = field(default_factory=dict)
    alarms: Alarms = field(default_factory=Alarms)

    def of(self, name: str, behaviour: Behaviour | None = None) -> FaultEffects:
        """Return the effects of a fault or a process by its name, as in ``radio`` or ``radio:out``.

        One that is not known affects what has its name: the alarms of the resource ``NAME_status``, and the skillset NAME. A fault that a
        behaviour of mocks declares has the states that are declared there.
        """
        what = name.partition(":")[0]
        found = self.known.get(what) or FaultEffects(self._of_name(what), ends=frozenset([f"{what}.*"]))
        fault = None if behaviour is None else behaviour.faults.get(name) or behaviour.faults.get(what)
        if fault is None:
            return found
        later = [_named(change.states) for change in fault.changes]
        return FaultEffects(_named(fault.states), frozenset().union(*later), found.ends | _named(fault.ends), found.told)

    def named(self, name: Callable[[str], str]) -> EffectsByFault:
        """Return it for skillsets and faults that are called otherwise: ``name`` makes what begins with such a name of what is here."""
        return EffectsByFault({name(what): one.named(name) for what, one in self.known.items()}, self.alarms.named(name))

    def _of_name(self, what: str) -> frozenset[str]:
        return frozenset(one for one in (*self.alarms.always, *self.alarms.away) if fnmatchcase(one, f"*.{what}_status *"))


def _named(words: Mapping[Place, str]) -> frozenset[str]:
    return frozenset(f"{'.'.join(place)} {word}" for place, word in words.items())
