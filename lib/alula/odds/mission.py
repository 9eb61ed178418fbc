"""Label the transition system of a mission for its odds: what the software does at once, what takes time, which faults come.

The system takes each step that only an unlucky robot takes. Here a step is taken by whatever the robot's files say takes it:

- a state that a fault of ``faults.yaml`` shows comes with that fault alone, and goes when it is mended;
- a state that a skill brings about (``then`` of its mock) comes with a success of that skill alone, but for one that the mocks'
  ``timeline`` has: before the mission begins that comes by itself;
- any other transition of the functional layer comes some time, or, if it breaks an invariant, is a fault of its own,
  ``skillset.resource STATE``;
- a broken invariant over data is a fault of its own, ``skillset.skill INVARIANT``, where no fault of ``faults.yaml`` brings it about.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import NamedTuple

from alula.missions.director import Outcome as Ended
from alula.model.expressions import And, Expression, ResourceIs
from alula.model.model import Skill
from alula.odds.figures import NEVER, Figures
from alula.odds.system import DEPARTURE, Kind, Outcome, Step
from alula.prove.mission.conditions import true_in
from alula.prove.mission.measured import DATA, FRESH
from alula.prove.mission.oracle import Asked
from alula.prove.mission.own import actions, failing_among
from alula.prove.mission.state import Event, State
from alula.prove.mission.state import Kind as Happens
from alula.prove.mission.system import System
from alula.prove.mission.words import choice
from alula.records.causes.effects import FaultEffects

Brought = Mapping[str, Collection[tuple[str, str]]]
"""By a skill, the states that its success brings about: resource and state."""
OUTCOMES = {Ended.ACCOMPLISHED: Outcome.ACCOMPLISHED, Ended.DEGRADED: Outcome.DEGRADED, Ended.GIVEN_UP: Outcome.GIVEN_UP}


ARRIVALS = frozenset({Happens.START, Happens.REFUSE, Happens.INTERRUPT})
TIME, PROGRESS = "time", "the progress of "
"""How the search asks whether a time is over, and whether the progress of a skill is large enough."""
SECOND_NS = 1e9
MOST_KNOWN = 1 << 14
"""Situations of which it is kept what can happen there."""


class Place(NamedTuple):
    """A situation of the system, the faults that are there, and the one that comes just now."""

    state: State
    faults: frozenset[str] = frozenset()
    coming: str = ""


class MissionSteps:
    """A mission with its models and faults, as a `LabelledSystem`.

    Args:
        system: of the mission.
        faults: what each brings about, by its name.
        brought: what skills bring about.
        departure: the resource and state that the robot leaves at its departure.
        figures: what may never happen is left out, and a transition that has figures of its own comes as these say.
        at_first: the states that come by themselves after power-up: resource and state.
    """

    def __init__(
        self,
        system: System,
        faults: Mapping[str, FaultEffects],
        brought: Brought,
        departure: tuple[str, str] | None = None,
        figures: Figures = Figures(),  # noqa: B008 - a value
        at_first: Collection[tuple[str, str]] = (),
    ) -> None:
        self._system = system
        self._faults = {name: one for name, one in faults.items() if _touches(one, system)}
        self._brought = brought
        known = {f"{of.name}.{one.name}" for of in system.skillsets for one in of.resources}
        self._achieved = {f"{of.name}.{one.name}": [*achieved(of.name, one)] for of in system.skillsets for one in of.skills}
        self._departure = departure if departure is not None and departure[0] in known else None
        self._figures = figures
        self._states = {pair for several in brought.values() for pair in several}
        self._at_first = frozenset(at_first)
        self._actions = actions(system.nodes)
        self._moves = lru_cache(maxsize=MOST_KNOWN)(lambda state: tuple(system.steps(state)))
        """What the system can do in a situation: it is the same whichever faults are there, and asked for by each of them."""
        self.steps_at = lru_cache(maxsize=MOST_KNOWN)(lambda place: tuple(self.steps(place)))
        """`steps`, kept for whoever looks at the same situations for several faults."""
        self._never_comes = lru_cache(maxsize=MOST_KNOWN)(self._never)

    def initial(self) -> list[Place]:
        """Return the situation at power-up."""
        return [Place(self._system.initial())]

    def outcome(self, state: Place) -> Outcome | None:
        """Return the outcome of a mission that has ended in order; None otherwise."""
        ended = self._system.outcome(state.state)
        return None if ended is None else OUTCOMES.get(ended)

    def resource(self, state: Place, name: str) -> str | None:
        """Return the state of ``skillset.resource``; None where no skillset of the mission has it."""
        known = any(one.name == name.partition(".")[0] for one in self._system.skillsets)
        return self._system.resource(state.state, name) if known else None

    def resources(self, state: Place) -> dict[str, str]:
        """Return the states of all resources that the mission depends on, by ``skillset.resource``."""
        names = [f"{of.name}.{one.name}" for of in self._system.skillsets for one in of.resources]
        found = ((name, self._system.resource(state.state, name)) for name in names)
        return {name: known for name, known in found if known is not None}

    def holds(self, state: Place, condition: Expression) -> bool:
        """Return whether a condition of a mission's property is true."""
        return true_in(self._system, condition, state.state)

    def may_end(self, state: Place, end: str) -> bool:
        """Return whether a fault is there that can bring about this end of an execution, ``skillset.skill END``."""
        return any(_any(self._faults[name].ends, end) for name in state.faults)

    def taken_away(self, before: Place, after: Place) -> frozenset[str]:
        """Return the resources that a step moves out of a state by which a present fault shows: ``skillset.resource``."""
        there = [self._faults[name].states for name in before.faults]
        moved = ((at, state) for at, state in self.resources(before).items() if there and state != self.resource(after, at))
        return frozenset(at for at, state in moved if any(_any(states, f"{at} {state}") for states in there))

    def comes_later(self, state: Place, shown: str) -> bool:
        """Return whether a state, ``skillset.resource STATE``, is reached only by the reaction to the present faults."""
        several = [self._faults[name] for name in state.faults]
        return any(_any(one.later, shown) for one in several) and not any(_any(one.states, shown) for one in several)

    def chosen(self, before: Place, after: Place) -> tuple[str, ...]:
        """Return, in words, the unknown values that a tick from one situation to the other assumed."""
        steps = self._moves(before.state)
        event = next((event for event, there in steps if event.kind is Happens.TICK and there == after.state), None)
        return () if event is None else tuple(words for one in _waited(event.choices)[1] if (words := choice(one)))

    def only_ends(self, fault: str) -> bool:
        """Return whether a fault only ends skills badly, and shows in no state of a resource."""
        return not self._faults[fault].states

    def steps(self, state: Place) -> Iterator[Step[Place]]:
        """Yield the steps out of a situation; none after an abort. Before the mission begins nothing fails, and it waits for its needs."""
        if self._system.outcome(state.state) is not None:
            return
        begun = self._system.started(state.state)
        for step in self._all_steps(state):
            if (begun or step.kind not in {Kind.FAULT, Kind.WAIT}) and not self._never_comes(step.kind, step.name, step.result):
                yield step

    def _never(self, kind: Kind, name: str, result: str) -> bool:
        if kind is Kind.FAULT:
            figures = self._figures.fault(name)
            return figures.rate == NEVER and not figures.chances
        return kind is Kind.END and self._figures.skill(name).fails.get(result) == NEVER

    def _all_steps(self, state: Place) -> Iterator[Step[Place]]:
        steps = self._moves(state.state)
        if state.coming:
            yield from self._strikes(state, steps)
            return
        arrivals = [(event, after) for event, after in steps if event.kind in ARRIVALS]
        first = next((event.skillset for event, _ in arrivals), None)
        if first is None:
            yield from self._ticks(state, [(event, after) for event, after in steps if event.kind is Happens.TICK])
        for event, after in steps:
            if event.kind not in ARRIVALS or event.skillset == first:
                yield from self._step(state, event, after)
        coming = (name for name in self._faults if name not in state.faults)
        yield from (Step(Kind.FAULT, name, Place(state.state, state.faults, name)) for name in coming)

    def _ticks(self, state: Place, ticks: Sequence[tuple[Event, State]]) -> Iterator[Step[Place]]:
        """Yield what the tree does: what it can do now, else what it waits for, one thing after the other."""
        told = [(*_waited(event.choices), state._replace(state=after)) for event, after in ticks]
        still = [(others, target) for waits, others, target in told if not waits]
        kind = Kind.NOW if _complete([others for others, _ in still]) else Kind.SOON
        for others, target in still:
            failing = failing_among(others, self._actions) or _silent(others)
            yield Step(kind if others else Kind.NOW, "tick", target, failing=failing)
        if kind is Kind.SOON:
            least = min((len(waits) for waits, _, _ in told if waits), default=0)
            for waits, _, target in told:
                if len(waits) == least == 1:
                    yield _wait(waits[0], target)
                elif len(waits) == least:
                    yield Step(Kind.SOON, "tick", target)

    def _step(self, state: Place, event: Event, after: State) -> Iterator[Step[Place]]:
        target = state._replace(state=after)
        match event.kind:
            case Happens.START:
                yield Step(Kind.NOW, event.skill, target, uses=(event.skill,))
            case Happens.REFUSE | Happens.INTERRUPT:
                yield Step(Kind.NOW, event.skill, target, event.result)
            case Happens.RESULT:
                brought = target if event.failure else target._replace(state=self._with_brought(event.skill, after))
                yield Step(Kind.END, event.skill, brought, event.result, self._left(state.state, brought.state))
                if event.failure and self.may_end(state, f"{event.skill} {event.result}"):
                    yield Step(Kind.ANY, f"{event.skill} {event.result}", target)
            case Happens.EXTERN:
                yield from self._extern(state, event, target)
            case Happens.BREAK | Happens.FAIL:
                end = f"{event.skill} {event.result or Happens.FAIL.value}"
                if not any(_any(one.ends, end) for one in self._faults.values()):
                    yield Step(Kind.FAULT, end, target)
                elif self.may_end(state, end):
                    yield Step(Kind.ANY, end, target)
            case Happens.EVENT:
                yield Step(Kind.ANY, event.skill, target)
            case _:
                pass  # deaths are faults of processes; nobody aborts

    def _extern(self, state: Place, event: Event, target: Place) -> Iterator[Step[Place]]:
        resource = event.skill
        shown = f"{resource} {event.result}"
        uses = self._left(state.state, target.state)
        showing = [name for name in state.faults if _any(self._faults[name].states, f"{resource} {event.source}")]
        if any(_brings(one, shown) for one in self._faults.values()):
            if any(_brings(self._faults[name], shown) for name in state.faults):
                yield Step(Kind.ANY, shown, target, uses=uses)
        elif showing:
            yield from (Step(Kind.MENDED, name, target._replace(faults=state.faults - {name}), uses=uses) for name in showing)
        elif (resource, event.result) not in self._states or self._comes_at_first(state.state, (resource, event.result)):
            yield Step(Kind.FAULT if event.failure or shown in self._figures.faults else Kind.SOON, shown, target, uses=uses)

    def _comes_at_first(self, state: State, pair: tuple[str, str]) -> bool:
        return pair in self._at_first and not self._system.started(state)

    def _strikes(self, state: Place, steps: Iterable[tuple[Event, State]]) -> Iterator[Step[Place]]:
        """Yield what the fault that comes may bring about first; the rest may follow, at any time while it is there."""
        there = Place(state.state, state.faults | {state.coming})
        effects = self._faults[state.coming]
        found = [after for event, after in steps if _shows(effects, event)]
        yield from (Step(Kind.NOW, state.coming, there._replace(state=after)) for after in found or [state.state])

    def _with_brought(self, skill: str, state: State) -> State:
        """Return a situation with what a success of the skill brings about, or achieves, where the models have a transition for it."""
        for resource, wanted in (*self._brought.get(skill, ()), *self._achieved.get(skill, ())):
            found = [after for event, after in self._moves(state) if _is_extern(event, resource, wanted)]
            state = found[0] if found else state
        return state

    def _left(self, before: State, after: State) -> tuple[str, ...]:
        if self._departure is None:
            return ()
        resource, state = self._departure
        left = self._system.resource(before, resource) == state != self._system.resource(after, resource)
        return (DEPARTURE,) if left else ()


def achieved(skillset: str, skill: Skill) -> Iterator[tuple[str, str]]:
    """Yield the states that a model declares after a success of a skill: resource and state."""
    several = skill.achieves.operands if isinstance(skill.achieves, And) else (skill.achieves,)
    yield from ((f"{skillset}.{one.resource}", one.state) for one in several if isinstance(one, ResourceIs) and not one.negated)


def _touches(fault: FaultEffects, system: System) -> bool:
    """Return whether a fault shows anything in a mission's skillsets; one that does not is none of its faults."""
    resources = [f"{of.name}.{one.name} {state}" for of in system.skillsets for one in of.resources for state in one.states]
    skills: dict[str, Skill] = {f"{leaf.skillset}.{leaf.model.name}": leaf.model for leaf in system.leaves}
    ends = [f"{name} {one.name}" for name, skill in skills.items() for one in skill.results]
    ends += [f"{name} {one.name}" for name, skill in skills.items() for one in skill.invariants]
    shown = any(_brings(fault, text) for text in resources)
    return shown or any(_any(fault.ends, text) for text in (*ends, *(f"{name} {Happens.FAIL.value}" for name in skills)))


def _silent(choices: Iterable[Asked]) -> str:
    """Return data of which a tick finds no fresh value; empty: there are none."""
    return next((str(one.question[1]) for one in choices if one.question[::2] == (DATA, FRESH) and one.answer is False), "")


def _waited(choices: Sequence[Asked]) -> tuple[list[Asked], list[Asked]]:
    """Return what has elapsed or progressed far enough by a tick, and its other choices."""
    timed = [asked for asked in choices if asked.question[0] == TIME or str(asked.question[1]).startswith(PROGRESS)]
    return [asked for asked in timed if asked.answer is True], [asked for asked in choices if asked not in timed]


def _wait(asked: Asked, target: Place) -> Step[Place]:
    kind, what, *_ = asked.question
    if kind == TIME:
        return Step(Kind.WAIT, f"{what} ns", target, seconds=float(str(what)) / SECOND_NS)
    return Step(Kind.WAIT, str(what).removeprefix(PROGRESS), target)


def _is_extern(event: Event, resource: str, state: str) -> bool:
    return event.kind is Happens.EXTERN and event.skill == resource and event.result == state


def _shows(effects: FaultEffects, event: Event) -> bool:
    word = event.result or event.kind.value
    if event.kind is Happens.EXTERN:
        return _any(effects.states, f"{event.skill} {word}")
    return event.kind in {Happens.RESULT, Happens.BREAK, Happens.FAIL} and _any(effects.ends, f"{event.skill} {word}")


@lru_cache(maxsize=1 << 14)  # a search asks the same few thousand pairs in each of its situations
def _any(patterns: frozenset[str], text: str) -> bool:
    return any(fnmatchcase(text, pattern) for pattern in patterns)


def _brings(effects: FaultEffects, shown: str) -> bool:
    """Return whether a fault brings about a state, or what is done about it does."""
    return _any(effects.states, shown) or _any(effects.later, shown)


def _complete(several: Sequence[Sequence[Asked]]) -> bool:
    """Return whether these ways of a tick are all of them; else one is missing, for it changes nothing: the tree waits."""
    if not several or any(not asked for asked in several):
        return bool(several)
    first = {asked[0].question: asked[0].options for asked in several}
    if len(first) > 1:
        return True  # choices are asked for one after another: this can't be
    (options,) = first.values()
    rests = [[asked[1:] for asked in several if asked[0].answer == option] for option in options]
    return all(_complete(rest) for rest in rests)
