"""Flights over mocks by the figures of a robot's `faults.yaml`: the chances and times that the odds are computed of.

Where the figures leave open what a fault brings about, all that it can comes at once, each in the first of its states: the odds are
bounds over all ways in which that can go.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from fractions import Fraction

from alula.common.faults import FaultRequest
from alula.missions.director import Outcome
from alula.missions.mocked import MockedMission
from alula.missions.plan import MissionPlan
from alula.mock import Behaviour, Ending, Rule
from alula.mock.behaviour import MockChange, MockFault, Place
from alula.mock.formula import Formula
from alula.model.model import ResultKind, Skillset
from alula.odds.figures import NEVER, Figures, Range, point
from alula.records.causes.effects import FaultEffects

BEGINS_S = 2.1
"""When the mission has begun, seconds of mission clock: the odds are of one that begins."""
LONG_S = 3000.0
"""No flight takes so long."""


def only(figures: Figures, an_hour: Mapping[str, int]) -> Figures:
    """Return figures of a robot on which these faults come so many times an hour, and no others: also not while skills run."""
    faults = {name: replace(one, rate=point(Fraction(an_hour.get(name, 0), 3600))) for name, one in figures.faults.items()}
    skills = {name: replace(one, fails=dict.fromkeys(one.fails, NEVER)) for name, one in figures.skills.items()}
    return Figures(faults, skills)


@dataclass(frozen=True)
class Flights:
    """Flights of a mission; each seed makes one."""

    plan: MissionPlan
    skillsets: tuple[Skillset, ...]
    behaviour: Behaviour
    figures: Figures

    @classmethod
    def by(
        cls, plan: MissionPlan, skillsets: tuple[Skillset, ...], known: Behaviour, figures: Figures, effects: Mapping[str, FaultEffects]
    ) -> Flights:
        """Make them of a robot's mocks, with the figures in the place of their times and ends; their faults are those of the effects."""
        rules = {(one.name, skill.name): _rules(figures, known, (one.name, skill.name)) for one in skillsets for skill in one.skills}
        faults = {name: fault for name in figures.faults if (fault := _fault(effects.get(name), skillsets)) is not None}
        behaviour = replace(Behaviour(rules=rules).over(known), faults=faults)
        return cls(plan, skillsets, behaviour, figures)

    def fly(self, seed: int) -> Outcome:
        """Fly once."""
        chance = random.Random(f"{seed} faults")  # noqa: S311 - for tests
        requests = [request for name in self.behaviour.faults if (request := self._drawn(name, chance)) is not None]
        return MockedMission(self.skillsets, self.behaviour, self.plan, faults=requests, seed=seed).run().outcome

    def _drawn(self, name: str, chance: random.Random) -> FaultRequest | None:
        fault = self.figures.faults[name]
        if fault.rate == NEVER:
            return None
        begin_s = BEGINS_S + chance.expovariate(number(fault.rate))
        lasts_s = None if fault.lasts is None else chance.expovariate(1 / number(fault.lasts))
        if begin_s >= LONG_S:
            return None
        return FaultRequest(name, "", begin_s, None if lasts_s is None else begin_s + lasts_s)


def number(known: Range) -> float:
    """Return a figure that is one number."""
    assert known.low == known.high
    return float(known.low)


def _rules(figures: Figures, known: Behaviour, place: Place) -> tuple[Rule, ...]:
    skill = figures.skills.get(".".join(place))
    if skill is None:
        return ()
    if skill.results:
        first, *others = ((name, number(chance)) for name, chance in skill.results.items())
        then = tuple(one for rule in known.rules.get(place, ()) for one in rule.changes or ())
        # What a success brings about comes with it, a moment before.
        changes = tuple(MockChange(Formula("delay * 0.999"), one.states) for one in then)
        fails = Rule(chance=sum(chance for _, chance in others), ending=Ending(results=tuple(others)), changes=())
        return fails, Rule(delay=Formula(f"exponential({number(skill.lasts)})"), ending=Ending(results=(first,)), changes=changes)
    rates = {name: number(rate) for name, rate in skill.fails.items() if rate != NEVER}
    return (Rule(delay=Formula(f"exponential({1 / sum(rates.values())})"), ending=Ending(results=tuple(rates.items()))),) if rates else ()


def _fault(effects: FaultEffects | None, skillsets: tuple[Skillset, ...]) -> MockFault | None:
    """Return what a fault does in a mission with these skillsets, None where it does nothing."""
    if effects is None:
        return None
    states: dict[Place, str] = {}
    for one in sorted((*effects.states, *effects.later)):
        place, _, state = one.partition(" ")
        skillset, _, resource = place.partition(".")
        if skillset in {known.name for known in skillsets}:
            states.setdefault((skillset, resource), state)
    ends = dict(_ends(effects, skillsets))
    return MockFault(states, ends=ends) if states or ends else None


def _ends(effects: FaultEffects, skillsets: tuple[Skillset, ...]) -> Iterator[tuple[Place, str]]:
    for skillset in skillsets:
        for skill in skillset.skills:
            for result in skill.results:
                end = f"{skillset.name}.{skill.name} {result.name}"
                if skill.kind_of(result.name) is ResultKind.FAILURE and any(fnmatchcase(end, pattern) for pattern in effects.ends):
                    yield (skillset.name, skill.name), result.name
