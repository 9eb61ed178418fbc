"""Ways to spoil a log of one skillset.

Where events are taken away, added or moved, the log is numbered and stamped again (``renumbered``): numbers alone would give it away,
and only what the events say is left to tell.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from alula.model.execution_state import ExecutionState
from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent

Log = Sequence[EngineEvent]


@dataclass(frozen=True)
class Spoiler:
    """What a way of spoiling may use: the model for other names, and chance."""

    skillset: Skillset
    chance: random.Random

    def other(self, names: Sequence[str], name: str) -> str:
        """Return another name than this one; an invented one where there is none."""
        return self.chance.choice([one for one in names if one != name] or [f"not_{name}"])


Mutation = Callable[[Spoiler, list[EngineEvent]], list[EngineEvent]]


def dropped(spoiler: Spoiler, log: list[EngineEvent]) -> list[EngineEvent]:
    """Leave an event out, not the last: what is left then would be a good log that ends earlier."""
    at = spoiler.chance.randrange(len(log) - 1)
    return log[:at] + log[at + 1 :]


def doubled(spoiler: Spoiler, log: list[EngineEvent]) -> list[EngineEvent]:
    """Have an event twice, one after the other."""
    at = spoiler.chance.randrange(len(log))
    return log[: at + 1] + log[at:]


def swapped(spoiler: Spoiler, log: list[EngineEvent]) -> list[EngineEvent]:
    """Return the log with two neighbouring events swapped."""
    at = spoiler.chance.randrange(len(log) - 1)
    return [*log[:at], log[at + 1], log[at], *log[at + 2 :]]


def moved(spoiler: Spoiler, log: list[EngineEvent]) -> list[EngineEvent]:
    """Put an event somewhere else."""
    source, target = spoiler.chance.sample(range(len(log)), 2)
    rest = log[:source] + log[source + 1 :]
    return [*rest[:target], log[source], *rest[target:]]


def renumbered(order: Mutation) -> Mutation:
    """Return a mutation whose log counts without gaps, with stamps that do not go back."""

    def mutate(spoiler: Spoiler, log: list[EngineEvent]) -> list[EngineEvent]:
        spoiled, stamp_ns, result = order(spoiler, log), 0, []
        for number, event in enumerate(spoiled, 1):
            stamp_ns = max(stamp_ns, event.stamp_ns)
            result.append(replace(event, sequence=number, stamp_ns=stamp_ns))
        return result

    return mutate


def _altered(kind: type[EngineEvent], alter: Callable[[Spoiler, EngineEvent, Log], EngineEvent]) -> Mutation:
    """Return a mutation that alters one event of a kind."""

    def mutate(spoiler: Spoiler, log: list[EngineEvent]) -> list[EngineEvent]:
        at = spoiler.chance.choice([number for number, event in enumerate(log) if isinstance(event, kind)])
        return [*log[:at], alter(spoiler, log[at], log), *log[at + 1 :]]

    return mutate


def _state(spoiler: Spoiler, event: EngineEvent, _: Log) -> EngineEvent:
    assert isinstance(event, ExecutionEvent)  # noqa: S101 - as ``_altered`` chooses
    other = spoiler.other([state.value for state in ExecutionState], event.state.value)
    return replace(event, state=ExecutionState(other))


def _result(spoiler: Spoiler, event: EngineEvent, _: Log) -> EngineEvent:
    assert isinstance(event, ExecutionEvent)  # noqa: S101
    skill = spoiler.skillset.skill(event.skill)
    names = ["", *(one.name for one in skill.results), *(one.name for one in skill.preconditions), *(one.name for one in skill.invariants)]
    return replace(event, result=spoiler.other(names, event.result))


def _skill(spoiler: Spoiler, event: EngineEvent, _: Log) -> EngineEvent:
    assert isinstance(event, ExecutionEvent)  # noqa: S101
    return replace(event, skill=spoiler.other([skill.name for skill in spoiler.skillset.skills], event.skill))


def _id(spoiler: Spoiler, event: EngineEvent, log: Log) -> EngineEvent:
    assert isinstance(event, ExecutionEvent)  # noqa: S101
    return replace(event, id=spoiler.other([one.id for one in log if isinstance(one, ExecutionEvent)], event.id))


def _to_state(spoiler: Spoiler, event: EngineEvent, _: Log) -> EngineEvent:
    assert isinstance(event, TransitionEvent)  # noqa: S101
    return replace(event, to_state=spoiler.other(spoiler.skillset.resource(event.resource).states, event.to_state))


def _from_state(spoiler: Spoiler, event: EngineEvent, _: Log) -> EngineEvent:
    assert isinstance(event, TransitionEvent)  # noqa: S101
    return replace(event, from_state=spoiler.other(spoiler.skillset.resource(event.resource).states, event.from_state))


def _resource(spoiler: Spoiler, event: EngineEvent, _: Log) -> EngineEvent:
    assert isinstance(event, TransitionEvent)  # noqa: S101
    return replace(event, resource=spoiler.other([one.name for one in spoiler.skillset.resources], event.resource))


def _cause(spoiler: Spoiler, event: EngineEvent, log: Log) -> EngineEvent:
    assert isinstance(event, TransitionEvent)  # noqa: S101
    causes = ["extern", *(one.cause for one in log if isinstance(one, TransitionEvent))]
    return replace(event, cause=spoiler.other(causes, event.cause))


MUTATIONS: dict[str, Mutation] = {
    "dropped": dropped,
    "dropped, renumbered": renumbered(dropped),
    "doubled": doubled,
    "doubled, renumbered": renumbered(doubled),
    "swapped": swapped,
    "swapped, renumbered": renumbered(swapped),
    "moved": moved,
    "moved, renumbered": renumbered(moved),
    "another state": _altered(ExecutionEvent, _state),
    "another result": _altered(ExecutionEvent, _result),
    "another skill": _altered(ExecutionEvent, _skill),
    "another id": _altered(ExecutionEvent, _id),
    "another target of a transition": _altered(TransitionEvent, _to_state),
    "another source of a transition": _altered(TransitionEvent, _from_state),
    "another resource": _altered(TransitionEvent, _resource),
    "another cause": _altered(TransitionEvent, _cause),
}
