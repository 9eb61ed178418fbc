"""The outcomes of a mission when chosen faults come and nothing else fails: is it accomplished, degraded or not, in every run?

The world's moves are those that the odds are computed from (`MissionSteps`): what a mission's skills bring about, what the functional layer
does in time, the chosen faults in their order, each at any moment, and whatever a fault that is there may bring about. A fault that has
come stays, but it ends skills badly, has requests refused by data, or brings back a state that a skill has taken away, no more often than
faults may come. Requests are not refused, and executions not ended, by data of which nothing is known, unless a fault that is there does
that. Data are told, and actions of the robot's own do not fail of which nobody knows what they do. Executions end well; fairness is the
prover's: what can happen again and again happens some time. So a mission survives when, from every situation that it can come into, it can
still be accomplished.

A state that comes `later`, of what others do about a fault, such as an autopilot that flies home by itself, may be one after which no
mission can do anything. So situations without such states are looked at first: a mission that survives in these does under an assumption.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from alula.common.graphs import ShortestWays, reachable_from
from alula.model.expressions import Expression
from alula.model.model import ResultKind, Skillset
from alula.odds.mission import MissionSteps, Place
from alula.odds.system import Kind, Outcome, Step
from alula.prove.limits import Deadline
from alula.prove.mission.state import Kind as Happens

GOOD = frozenset({Outcome.ACCOMPLISHED, Outcome.DEGRADED})
MOST_FAULTS = 2
"""How often a fault strikes that ends skills, or comes again once a skill has taken its state away, unless more is asked for."""


class Here(NamedTuple):
    """A situation, how many of the faults have come, and how often they have struck again.

    Attributes:
        place: the situation.
        come: how many have come, in their order.
        struck: how often they have ended skills badly, had requests refused by data, or brought back what a skill had taken away.
        away: the resources that a success has taken out of the state of a fault, and that are not back in it.
    """

    place: Place
    come: int = 0
    struck: int = 0
    away: frozenset[str] = frozenset()


@dataclass(frozen=True)
class _Ends:
    """How executions end: by ``skillset.skill`` the good results, and ``skillset.skill END`` of the bad ones and of broken invariants."""

    good: Mapping[str, frozenset[str]]
    bad: frozenset[str]

    @classmethod
    def of(cls, skillsets: Sequence[Skillset]) -> _Ends:
        good: dict[str, frozenset[str]] = {}
        bad: set[str] = set()
        for skillset in skillsets:
            for skill in skillset.skills:
                name = f"{skillset.name}.{skill.name}"
                good[name] = frozenset(one.name for one in skill.results if skill.kind_of(one.name) is ResultKind.SUCCESS)
                ends = [*(one.name for one in skill.results), *(one.name for one in skill.invariants)]
                bad |= {f"{name} {one}" for one in ends if one not in good[name]}
                bad.add(f"{name} {Happens.FAIL.value}")
        return cls(good, frozenset(bad))


@dataclass(frozen=True)
class Fate:
    """The outcomes of a mission with these faults.

    Attributes:
        faults: those that come, in their order.
        outcomes: how it can end after them; ``none``: it may also wait for ever.
        survives: it is always accomplished, degraded or not.
        safe: it always ends, and each robot is at rest, at home or somebody else's then.
        run: what happens in a run after which it can't be accomplished any more.
        states: those of the resources then.
        refused: what is refused on the shortest way from there to an end: ``skillset.skill``, and the precondition.
        chosen: what the tick that leads there took a value for that nobody knows, in words.
        situations: how many were looked at.
        again: whether a fault struck more than once in these runs, or could have: the answer holds for as often as was asked.
        assuming: where it does not survive, the states, ``skillset.resource STATE``, without which it would, of those that come later;
            with them it ends safely all the same. Empty: there are no such states.
    """

    faults: tuple[str, ...]
    outcomes: frozenset[str]
    survives: bool
    safe: bool
    run: tuple[str, ...]
    states: Mapping[str, str]
    situations: int
    assuming: tuple[str, ...] = ()
    refused: tuple[tuple[str, str], ...] = ()
    chosen: tuple[str, ...] = ()
    again: bool = False

    @property
    def answered(self) -> bool:
        """Return whether it survives, at least under an assumption."""
        return self.survives or bool(self.assuming)

    def as_dict(self) -> dict[str, object]:
        """Return the fate as plain values for JSON."""
        return {
            "faults": list(self.faults),
            "survives": self.survives,
            "assuming": list(self.assuming),
            "safe": self.safe,
            "outcomes": sorted(self.outcomes),
            "run": list(self.run),
        }


def fate_of(
    steps: MissionSteps,
    skillsets: Sequence[Skillset],
    faults: Sequence[str],
    deadline: Deadline,
    rest: Sequence[Sequence[tuple[str, str]]] = (),
    most: int | None = None,
    goal: Expression | None = None,
    strikes: int = MOST_FAULTS,
    reached: Expression | None = None,
) -> Fate | None:
    """Return the fate; None: more than ``most`` situations. ``rest`` are states of resources, in one of which each robot is safe.

    With a ``goal``, a mission survives, too, when it comes to be true after the faults; what has to be ``reached`` is true at a good end.
    Faults strike ``strikes`` times.

    Raises OutOfTimeError.
    """
    ends = _Ends.of(skillsets)

    def is_good(here: Here) -> bool:
        accomplished = steps.outcome(here.place) in GOOD and (reached is None or steps.holds(here.place, reached))
        return accomplished or (goal is not None and here.come == len(faults) and steps.holds(here.place, goal))

    def following(here: Here) -> list[tuple[Step[Place], Here]]:
        deadline.check()
        return [] if steps.outcome(here.place) is not None else _following(steps, here, faults, ends, strikes)

    graph = _Graph([Here(place) for place in steps.initial()], following)
    if not graph.explore(lambda here, step: steps.comes_later(here.place, step.name), most):
        return None
    lost_before = graph.first_without_way(is_good)
    later = graph.put_off
    if later and not graph.explore(lambda _here, _step: False, most):
        return None
    lost = graph.first_without_way(is_good) if later else lost_before
    ended = [one for one in graph.ways.found if steps.outcome(one.place) is not None]
    at_rest = all(any(steps.resource(one.place, name) == state for name, state in safe) for one in ended for safe in rest)
    safe = at_rest and graph.first_without_way(lambda here: steps.outcome(here.place) is not None) is None
    last = [steps.outcome(one.place) for one in graph.ways.found if one.come == len(faults) and one in graph.ends]
    outcomes = frozenset("none" if one is None else one.value for one in last)
    run, states = ((), {}) if lost is None else (graph.run_to(lost), steps.resources(lost.place))
    assuming = tuple(later) if safe and lost is not None and lost_before is None else ()
    refused = () if lost is None else _refused(lost, following, lambda here: steps.outcome(here.place) is not None)
    before = None if lost is None else graph.ways.before(lost)
    chosen = () if lost is None or before is None else steps.chosen(before.place, lost.place)
    again = any(one.struck or one.away for one in graph.ways.found)
    return Fate(tuple(faults), outcomes, lost is None, safe, run, states, len(graph.ways.found), assuming, refused, chosen, again)


def _refused(
    first: Here, following: Callable[[Here], list[tuple[Step[Place], Here]]], is_end: Callable[[Here], bool]
) -> tuple[tuple[str, str], ...]:
    """Return the requests that are refused on the shortest way from a situation to an end of the mission."""
    ways = ShortestWays([first], following)
    end = next((one for one in ways if is_end(one)), None)
    several = [] if end is None else [one for one in ways.to(end) if one.kind is Kind.NOW and one.result]
    return tuple(dict.fromkeys((one.name, one.result) for one in several))


class _Graph:
    """The situations that a mission can come into, looked at breadth first; some steps may be put off.

    Attributes:
        ways: to all that were found.
        ends: those that nothing follows.
        put_off: the names of the steps that `explore` has put off.
    """

    def __init__(self, first: Sequence[Here], following: Callable[[Here], list[tuple[Step[Place], Here]]]) -> None:
        self.ways = ShortestWays(first, self._next)
        self.ends: set[Here] = set()
        self._following = following
        self._is_put_off: Callable[[Here, Step[Place]], bool] = lambda _here, _step: False
        self._leading: dict[Here, list[Here]] = {}
        self._later: list[tuple[Here, Step[Place], Here]] = []

    @property
    def put_off(self) -> list[str]:
        """The names of the steps that the last `explore` has put off."""
        return sorted({step.name for _, step, _ in self._later})

    def explore(self, is_put_off: Callable[[Here, Step[Place]], bool], most: int | None) -> bool:
        """Explore the steps put off before, except those put off now; return False where there are more situations than ``most``."""
        several, self._later, self._is_put_off = self._later, [], is_put_off
        for here, step, there in several:
            self._leading.setdefault(there, []).append(here)
            self.ways.add(here, step, there)
        for here, _, there in self.ways.steps():
            self._leading.setdefault(there, []).append(here)
            if most is not None and len(self.ways.found) > most:
                return False
        return most is None or len(self.ways.found) <= most

    def _next(self, here: Here) -> Iterator[tuple[Step[Place], Here]]:
        found = self._following(here)
        if not found:
            self.ends.add(here)
        for step, there in found:
            if self._is_put_off(here, step):
                self._later.append((here, step, there))
            else:
                yield step, there

    def first_without_way(self, is_good: Callable[[Here], bool]) -> Here | None:
        """Return the first situation found from which no good situation is reachable; None: there is none."""
        hopeful = reachable_from(filter(is_good, self.ways.found), lambda one: self._leading.get(one, ()))
        return next((one for one in self.ways.found if one not in hopeful), None)

    def run_to(self, here: Here) -> tuple[str, ...]:
        """Return the events of a run to a situation."""
        lines = [_told(step) for step in self.ways.to(here)]
        return tuple(line for line in lines if line)


def needs(steps: MissionSteps, skillsets: Sequence[Skillset], skill: str, deadline: Deadline) -> bool:
    """Return whether every run in which nothing fails, and the mission is accomplished, starts a skill; raises OutOfTimeError."""
    ends = _Ends.of(skillsets)

    def following(here: Here) -> Iterator[tuple[Step[Place], Here]]:
        deadline.check()
        return (one for one in _following(steps, here, (), ends, 0, also_failing=True) if skill not in one[0].uses)

    without = ShortestWays((Here(place) for place in steps.initial()), following)
    return not any(steps.outcome(here.place) in GOOD for here in without)


def _following(
    steps: MissionSteps, here: Here, faults: Sequence[str], ends: _Ends, strikes: int, *, also_failing: bool = False
) -> list[tuple[Step[Place], Here]]:
    """Return the steps that are taken; while the software is at work, nothing but a fault comes between.

    ``also_failing``: what may fail though no fault says so, fails, too.
    """
    place = here.place
    found: list[tuple[Step[Place], Here]] = []
    several = steps.steps_at(place)
    can_start = {step.name for step in several if step.uses and step.kind is Kind.NOW}
    for step in (one for one in several if not _is_left_out(one, ends, also_failing=also_failing)):
        there = here._replace(place=step.target)
        match step.kind:
            case Kind.FAULT:
                if here.come < len(faults) and step.name == faults[here.come]:
                    found.append((step, there._replace(come=here.come + 1)))
            case Kind.END:
                found.append((step, there._replace(away=here.away | steps.taken_away(place, step.target))))
            case Kind.NOW if place.coming:
                struck = steps.only_ends(place.coming) and step.target.state != place.state
                found.append((step, there._replace(struck=min(here.struck + struck, strikes))))
            case Kind.NOW if step.result and step.name in can_start:  # a refusal by data, which are as they should be without a fault
                if steps.may_end(place, f"{step.name} {step.result}"):
                    found += _again(step, there, strikes)
            case Kind.ANY if step.name in ends.bad:
                found += _again(step, there, strikes)
            case Kind.ANY if (resource := step.name.rpartition(" ")[0]) in here.away:  # it has come once with the fault
                found += _again(step, there._replace(away=here.away - {resource}), strikes - 1)
            case _:
                if step.target != place:
                    found.append((step, there))
    now = [one for one in found if one[0].kind in {Kind.NOW, Kind.FAULT}]
    return now if any(step.kind is Kind.NOW for step, _ in now) else found


def _is_left_out(step: Step[Place], ends: _Ends, *, also_failing: bool) -> bool:
    """Return whether a step is none here: a fault stays, and nothing else fails."""
    fails = bool(step.failing) and not also_failing and step.kind is not Kind.FAULT
    return step.kind is Kind.MENDED or fails or (step.kind is Kind.END and step.result not in ends.good[step.name])


def _again(step: Step[Place], there: Here, most: int) -> list[tuple[Step[Place], Here]]:
    """Return a step with which a fault strikes again; nothing where it has struck often enough."""
    return [(step, there._replace(struck=there.struck + 1))] if there.struck < most else []


def _told(step: Step[Place]) -> str:
    match step.kind:
        case Kind.FAULT:
            return f"the fault {step.name} comes"
        case Kind.END:
            return f"{step.name} ends with {step.result}"
        case Kind.NOW if step.uses:
            return f"{step.name} starts"
        case Kind.ANY | Kind.SOON if step.name != "tick":
            return step.name
    return ""
