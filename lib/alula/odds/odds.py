"""The odds of a mission: its outcomes' least and greatest chances, the time it takes, the faults that cost most, what a change brings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from alula.common.located_yaml import choices
from alula.odds.errors import OddsError
from alula.odds.figures import NEVER, Figures, Range
from alula.odds.graph import Graph, without_figures
from alula.odds.hurry import unhurried
from alula.odds.process import Process, contracted, quantify
from alula.odds.storm import Number, Storm
from alula.odds.system import Kind, Outcome

WELL = (Outcome.ACCOMPLISHED, Outcome.DEGRADED)
NEITHER = "neither"
PER_HOUR = 3600.0
_UNITS = re.compile(r"(?P<name>\S+?)=(?P<units>\d+|never)")


@dataclass(frozen=True)
class Between:
    """The least and the greatest value, over all choices that no model and no figure decides."""

    least: Number
    most: Number


@dataclass(frozen=True)
class Cost:
    """What a fault costs: of the least chance that the mission is accomplished, degraded or not.

    Attributes:
        name: of the fault, with ``at USE`` for its chance at a use, or of an end of a skill.
        slope: how much the chance changes, per fault an hour, or per 1 of a chance.
        without: how much greater it is where the fault never comes; None: that is no change of one figure.
    """

    name: str
    slope: float
    without: float | None


@dataclass(frozen=True)
class Odds:
    """The odds of a mission.

    Attributes:
        outcomes: the chance of each way to end.
        seconds: the mean time to the end, least and greatest; None where it has no bound.
        costs: of the faults, the greatest first.
        situations: how many the mission can come into.
        states: of the decision process that they were reduced to.
        open: how many situations were found and not looked at.
        lacking: the faults, transitions and skills of this mission that have no figures, so that their chances are 0 to 1.
    """

    outcomes: dict[str, Between]
    seconds: tuple[Number | None, Number | None]
    costs: tuple[Cost, ...]
    situations: int
    states: int
    open: int
    lacking: tuple[str, ...] = ()


def odds_of(graph: Graph, figures: Figures, *, costs: bool = True) -> Odds:
    """Return the odds of a graph with figures; raises OddsError where Storm is not installed."""
    process = _process(graph, figures)
    storm = Storm(process)
    found = {one.value: _between(storm, [one]) for one in Outcome}
    ended = _between(storm, list(Outcome))
    found[NEITHER] = Between(ended.most.complement(), ended.least.complement())
    seconds = storm.seconds(most=False), storm.seconds(most=True)
    return Odds(
        found,
        seconds,
        _costs(graph, figures, storm) if costs else (),
        len(graph.steps) + graph.left - bool(graph.left),
        len(process.choices),
        graph.left,
        tuple(without_figures(graph, figures)),
    )


def _process(graph: Graph, figures: Figures) -> Process:
    return contracted(unhurried(quantify(graph, figures)))


def _between(storm: Storm, outcomes: Sequence[Outcome]) -> Between:
    return Between(*(storm.chance(outcomes, most=most).number for most in (False, True)))


def _costs(graph: Graph, figures: Figures, storm: Storm) -> tuple[Cost, ...]:
    """Return what each fault costs, the dearest first."""
    least = storm.chance(WELL, most=False)
    slopes = {name: slope * (1.0 if " at " in name else 1 / PER_HOUR) for name, slope in storm.slopes(least).items()}
    faults = {step.name for steps in graph.steps for step in steps if step.kind is Kind.FAULT}
    found = []
    for name in sorted(faults | set(slopes)):
        without = None
        if name in faults:
            spared = Storm(_process(graph, figures.with_fault(name, rate=NEVER, chances={})), exact=False).chance(WELL, most=False)
            without = spared.number.value - least.number.value
        found.append(Cost(name, slopes.get(name, 0.0), without))
    return tuple(sorted(found, key=lambda cost: (-(cost.without or 0.0), cost.slope, cost.name)))


def changed(figures: Figures, text: str, graph: Graph) -> Figures:
    """Return the figures with one change, as ``--with`` has it: ``camera=2``, so many units of what fails; ``camera=never``.

    Raises:
        OddsError: it is not written so, or there is no such fault.
    """
    match = _UNITS.fullmatch(text)
    if match is None or match["units"] == "0":
        raise OddsError(f"--with {text}: write FAULT=UNITS for several that must all fail, as camera=2, or FAULT=never")
    faults = sorted({step.name for steps in graph.steps for step in steps if step.kind is Kind.FAULT})
    name = match["name"]
    if name not in faults:
        raise OddsError(f"--with {text}: no fault `{name}` can come in this mission; there are {choices(name, faults)}")
    if match["units"] == "never":
        return figures.with_fault(name, rate=NEVER, chances={})
    units, fault = int(match["units"]), figures.fault(name)
    if fault.stages > 1:
        raise OddsError(f"--with {text}: the time to `{name}` has {fault.stages} stages; several units are reckoned with one stage each")
    chances = {use: Range(one.low**units, None if one.high is None else one.high**units) for use, one in fault.chances.items()}
    return figures.with_fault(name, units=units, chances=chances)
