"""Whether the properties of a mission's file hold in all its runs.

NEVER and ALWAYS speak of single situations: the regions have them. EVENTUALLY and LEADS_TO speak of what must come once the mission has
begun. It never comes where no calm step leads to it (``calm``). So a mission that can come to its end from everywhere comes to whatever is
the case at each of its ends. Otherwise the situations are looked at one after another, each with what is still to come. With
``within N ticks`` it has not come after so many ticks, whatever happens.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from alula.common.graphs import ShortestWays, reachable_from
from alula.language.errors import Severity
from alula.model.expressions import Constant, Expression, Not, ResourceIs, SkillRuns, atoms
from alula.model.model import Property, PropertyKind
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.calm import calm_of
from alula.prove.mission.conditions import Faults, faults_shown, true_in
from alula.prove.mission.fitting import Values, agree, all_values
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionFinding, run_of
from alula.prove.mission.state import Event, Kind, State
from alula.prove.mission.system import System
from alula.prove.mission.words import situation, told

CODE = "ALU714"
SINGLE = frozenset({PropertyKind.NEVER, PropertyKind.ALWAYS})
Awaiting = tuple[State, int]
"""A situation, and in how many ticks at most something is to come: 0 where nothing is."""


@dataclass(frozen=True)
class Held:
    """The result for a property: a run against it, None where none was found; ``complete``: all runs were looked at."""

    finding: MissionFinding | None
    complete: bool


def held(regions: Regions, one: Property, faults: Faults, deadline: Deadline, *, always_ends: bool = False) -> Held:
    """Decide whether a property holds; ``always_ends``: calm steps lead to an end of the mission from everywhere (``Waits``)."""
    system = regions.system
    if always_ends and one.fair and not one.within and _somewhere(regions, Not(_goal(one)), at_ends=True) is None:
        return Held(None, complete=True)
    if one.kind in SINGLE:
        run = _somewhere(regions, one.condition if one.kind is PropertyKind.NEVER else Not(one.condition))
        complete, what = regions.complete, "it can come to this"
    else:
        search = _Search(system, one, faults)
        try:
            deadline.doing = f"the property `{one.name}`"
            search.explore(deadline)
            complete = True
        except (OutOfTimeError, KeyboardInterrupt):
            complete = False
        run = search.against()
        what = f"it has not come after {one.within} ticks" if one.within else "it never comes, unless something else changes"
    if run is None:
        return Held(None, complete)
    events, state = run
    said = f"`{one.name}` ({one.kind.value}{f' within {one.within} ticks' if one.within else ''}"
    said += f"{', assuming termination' if one.fair else ''})"
    lines = (*told(system, events), f"=> {what}: {situation(system, state)}")
    message = f"the property {said} does not hold"
    cure = "mend the mission or the model, or the property where it asks for too much"
    return Held(MissionFinding(CODE, message, one.span, Severity.ERROR, cure, example=lines, run=run_of(system, events, state)), complete)


# --- single situations --------------------------------------------------------------------------------------------------


def _goal(one: Property) -> Expression:
    """Return the condition that a property requires to become true."""
    return one.condition if one.kind is PropertyKind.EVENTUALLY else one.consequence or Constant(value=False)


def _somewhere(regions: Regions, bad: Expression, *, at_ends: bool = False) -> tuple[list[Event], State] | None:
    """Return a run to a situation in which this is true, by as few ticks as any; ``at_ends``: in which the mission has begun and ended."""
    system = regions.system
    kinds: dict[tuple[int, int], tuple[bool, ...]] = {}
    asked = [[atom for atom in atoms(bad) if _place(system, atom) == place] for place in range(len(system.skillsets))]
    first = system.initial()

    def kind(place: int, number: int) -> tuple[bool, ...]:
        if (place, number) not in kinds:
            state = State(first.memory, (*first.managers[:place], number, *first.managers[place + 1 :]))
            kinds[place, number] = tuple(true_in(system, atom, state) for atom in asked[place])
        return kinds[place, number]

    for number, region in enumerate(regions.regions):
        memory = system.ticker.memories[region.memory]
        if at_ends and not (memory.started and memory.end is not None):
            continue
        choices = []
        for place, closure in enumerate(region.closures):
            soonest: dict[tuple[bool, ...], int] = {}
            for managers in sorted(closure.all, key=closure.depth.__getitem__):
                soonest.setdefault(kind(place, managers), managers)
            choices.append(tuple(soonest.values()))
        for combined in product(*choices):
            state = State(region.memory, combined)
            if true_in(system, bad, state):
                return regions.run(number, dict(enumerate(combined))), state
    return None


def _place(system: System, atom: object) -> int | None:
    match atom:
        case ResourceIs(resource=name) | SkillRuns(skill=name):
            return next(place for place, one in enumerate(system.skillsets) if one.name == name.partition(".")[0])
    return None


# --- what must come -----------------------------------------------------------------------------------------------------


class _Search:
    """All situations, each with what is still to come there, and the calm steps between those where something is."""

    def __init__(self, system: System, one: Property, faults: Faults) -> None:
        self._system = system
        self._one = one
        self._faults = faults
        self._begins = Constant(value=True) if one.kind is PropertyKind.EVENTUALLY else one.condition
        self._goal = _goal(one)
        self._calm_before: dict[Awaiting, list[tuple[Event, Awaiting]]] = {}
        self._calm_after: dict[Awaiting, list[tuple[Event, Awaiting]]] = {}
        state = system.initial()
        self._ways = ShortestWays([(state, self._awaits(state, 0, None))], self._following)
        self._late: tuple[list[Event], State] | None = None
        """A run after which it comes too late."""

    def explore(self, deadline: Deadline) -> None:
        """Look at all of them; raises OutOfTimeError."""
        calm = calm_of(self._system, terminating=self._one.fair)
        for here, event, there in self._ways.steps():
            deadline.check()
            if here[1] and calm(event):
                self._calm_before.setdefault(there, []).append((event, here))
                self._calm_after.setdefault(here, []).append((event, there))
            if there[1] < 0:
                self._late = ([*self._ways.to(here), event], there[0])
                return

    def _following(self, here: Awaiting) -> Iterator[tuple[Event, Awaiting]]:
        for event, after in self._steps(here):
            yield event, (after, self._awaits(after, here[1], event))

    def _steps(self, here: Awaiting) -> Iterator[tuple[Event, State]]:
        state, awaits = here
        yield from self._system.steps(state)
        if self._one.within and awaits and self._system.outcome(state) is None:
            idle = self._system.stays(state)
            if idle is not None:
                yield idle, state

    def _awaits(self, state: State, before: int, event: Event | None) -> int:
        """Return in how many ticks it is to come, -1 where that is over."""
        if true_in(self._system, self._goal, state):
            return 0
        if before:
            ticked = bool(self._one.within) and event is not None and event.kind is Kind.TICK
            return (before - 1 or -1) if ticked else before
        shown = frozenset() if event is None else faults_shown(event, self._faults)
        begins = self._system.started(state) and true_in(self._system, self._begins, state, shown)
        return (self._one.within or 1) if begins else 0

    def against(self) -> tuple[list[Event], State] | None:
        """Return a run after which the condition becomes true too late, or never."""
        if self._one.within:
            return self._late
        several = all_values(self._system.ticker.about_data)
        return next((self._at_rest(one, values) for values in several for one in self._never(values)), None)

    def _never(self, values: Values) -> Iterator[Awaiting]:
        """Yield where it never comes while data have these values."""
        before = {there: [here for event, here in ways if agree(values, event.choices)] for there, ways in self._calm_before.items()}
        # What was not looked at any further may lead anywhere.
        reached = (one for one in self._ways.found if not one[1])
        good = reachable_from([*reached, *self._ways.open], lambda one: before.get(one, ()))
        yield from (one for one in self._ways.found if one not in good)

    def _at_rest(self, found: Awaiting, values: Values) -> tuple[list[Event], State]:
        """Return a run that goes on until nothing calm happens any more, where that is possible: one sees best there what is waited for."""

        def following(here: Awaiting) -> list[tuple[Event, Awaiting]]:
            return [one for one in self._calm_after.get(here, ()) if agree(values, one[0].choices)]

        ways = ShortestWays([found], following)
        rest = next((here for here in ways if not following(here)), found)
        return self._ways.to(found) + ways.to(rest), rest[0]
