"""A game over the managers of a skillset: can any mission at all run a skill while a fault is present?

The mission may start and interrupt every skill at any time. The world helps it as well as it can, but the fault that has come stays: no
state that it shows is left for one that it does not show. Where even so the skill never runs after the fault, no tree can have it run; the
counterplay is the fault, and each request's refusal. Steps are those of the managers (`ManagersSteps`), as the proofs take them.

It is played with what matters alone: the resources of the fault and of the skill, the skills and events that change these, and what lets
those happen. What all others do changes nothing of that.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from alula.common.graphs import ShortestWays
from alula.model.expressions import TRUE, And, ResourceIs, SkillRuns
from alula.model.model import Property, PropertyKind, Skill, Skillset
from alula.prove.limits import Deadline
from alula.prove.mission.managers import ENDED, RUNNING, SENT, End, Failures, ManagersSteps
from alula.prove.mission.state import Event, Execution, Kind, Managers
from alula.prove.skillset.few import parts_around

HELPFUL = Failures(refusals=False, hooks=False, aborts=False)
Here = tuple[Managers, bool]
"""Managers, and whether the fault has come."""


@dataclass(frozen=True)
class Game:
    """The result of a game.

    Attributes:
        won: the skill can run while the fault is there.
        refused: the preconditions by which its requests are refused then.
        situations: how many were looked at.
    """

    won: bool
    refused: tuple[str, ...]
    situations: int


def played(skillset: Skillset, skill: str, states: Collection[tuple[str, str]], deadline: Deadline) -> Game:
    """Play the game for a skill; ``states`` are those that show the fault, each a resource of the skillset and its state.

    Raises OutOfTimeError.
    """
    mattering = _mattering(skillset, skill, states)
    leaves = {number: one.name for number, one in enumerate(mattering.skills)}
    steps = ManagersSteps(mattering, leaves, HELPFUL, _as_it_is)
    number = next(leaf for leaf, name in leaves.items() if name == skill)

    def following(here: Here) -> Iterator[tuple[Event | None, Here]]:
        deadline.check()
        return _moves(steps, here, leaves, states)

    first: Here = (steps.initial(), False)
    ways, refused = ShortestWays([first], following), dict[str, None]()
    for _, event, (managers, come) in ways.steps():
        if come and event is not None and event.leaf == number:
            if event.kind is Kind.START and any(one.leaf == number and one.phase == RUNNING for one in managers.executions):
                return Game(won=True, refused=(), situations=len(ways.found))
            if event.kind is Kind.REFUSE:
                refused[event.result] = None
    return Game(won=False, refused=tuple(refused), situations=len(ways.found))


def _mattering(skillset: Skillset, skill: str, states: Collection[tuple[str, str]]) -> Skillset:
    """Return the part of a skillset that decides whether a skill can run."""
    asked = And((SkillRuns(skill), *(ResourceIs(name, state) for name, state in states)))
    *_, part = parts_around(skillset, Property("runs", PropertyKind.NEVER, asked))
    return replace(
        skillset,
        resources=tuple(one for one in skillset.resources if one.name in part.resources),
        skills=tuple(_without_postconditions(one) for one in skillset.skills if one.name in part.skills),
        events=tuple(one for one in skillset.events if one.name in part.events),
        properties=(),
    )


def _without_postconditions(skill: Skill) -> Skill:
    """Return a skill without what decides only how its end is called."""
    results = tuple(replace(one, postcondition=TRUE) for one in skill.results)
    return replace(skill, results=results, interrupt=replace(skill.interrupt, postcondition=TRUE))


def _moves(
    steps: ManagersSteps, here: Here, leaves: Collection[int], states: Collection[tuple[str, str]]
) -> Iterator[tuple[Event | None, Here]]:
    managers, come = here
    known = [one for one in managers.executions if one.phase != ENDED]
    for leaf in leaves:
        if all(one.leaf != leaf for one in known):
            yield None, (_with(managers, [*known, Execution(leaf, SENT)]), come)
    for one in known:
        if not one.asked:
            yield None, (_with(managers, [other if other != one else one._replace(asked=True) for other in known]), come)
    for event, after in steps.moves(managers):
        shows = event.kind is Kind.EXTERN and (event.name, event.result) in states
        leaves_fault = event.kind is Kind.EXTERN and (event.name, event.source) in states and not shows
        if not (come and leaves_fault):
            yield event, (_with(after, [one for one in after.executions if one.phase != ENDED]), come or shows)


def _with(managers: Managers, executions: Collection[Execution]) -> Managers:
    running = [one for one in executions if one.phase == RUNNING]
    return Managers(managers.states, (*running, *sorted(one for one in executions if one.phase != RUNNING)))


def _as_it_is(_leaf: int, end: End) -> End:
    return end
