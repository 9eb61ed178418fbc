"""Find the faults of a run, their consequences, and how the mission reacted (see ``alula.records.causes``)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypedDict

from alula.common.faults import DIED, MENDED, FaultChange, parse_fault
from alula.common.scenarios import Scenario
from alula.records.causes.effects import EffectsByFault
from alula.records.causes.faults import Fault, Traced, faults_asked, faults_told, trace
from alula.records.causes.responses import Response, response_to_fault
from alula.report.facts import RunFacts
from alula.report.history import History
from alula.report.observed import Observed
from alula.report.phases import Phases


@dataclass(frozen=True)
class FaultResponse:
    """A fault, what followed from it, and the recovery's seconds; ``mode`` is empty where it is not known in which way it failed."""

    what: str
    mode: str
    traced: Traced
    response: Response
    after_s: float | None


class ResponseSummary(TypedDict):
    """A fault, a process that died, or what else ended what the mission was for, and what followed from it (``alula.records.causes``).

    ``told``: what happened to ``sensor``, in the robot's word, such as "lost". ``injected``: it was made to fail. ``until_s`` None: it
    stayed. ``detected_by``: the change of a resource, or the end of a skill, that told of it first. ``failed``: the executions that failed
    because of it. ``answered_by``, ``skill`` and ``after_s`` are as in the table of a campaign.
    """

    sensor: str
    mode: str
    told: str
    injected: bool
    t_s: float | None
    until_s: float | None
    detected_s: float | None
    detected_by: str
    failed: list[str]
    answered_by: str
    skill: str
    after_s: float | None


Known = tuple[FaultChange, Fault]
"""What failed as it is told, and as a cause."""


def injected(observed: Observed) -> tuple[FaultChange, ...]:
    """Return the faults, in the order of time."""
    return tuple(change for change in observed.all_faults if change.mode != MENDED)


def known_faults(
    facts: RunFacts, scenario: Scenario, history: History, observed: Observed, phases: Phases, effects: EffectsByFault
) -> list[Known]:
    """Return every fault of the run that is known by what was asked for and recorded, and every process that died."""
    return [
        *faults_told(observed.all_faults, effects),
        *_asked(facts, scenario, history, phases, effects),
        *_died(facts, scenario, observed, effects),
    ]


def find_responses(known: Sequence[Known], history: History) -> tuple[FaultResponse, ...]:
    """Return every fault with the response to it, in the order of time."""
    known = sorted(known, key=lambda one: one[1].at_s)
    found = []
    for (change, _), traced in zip(known, trace([fault for _, fault in known], history.events), strict=True):
        response, after_s = response_to_fault(traced, history.events, history.places)
        found.append(FaultResponse(change.sensor, change.mode, traced, response, after_s))
    return tuple(found)


def _asked(facts: RunFacts, scenario: Scenario, history: History, phases: Phases, effects: EffectsByFault) -> Iterator[Known]:
    """Yield the faults that were requested and that no recording tells of, such as the simulated radio's."""
    if not facts.mock:
        untold = dict(scenario.faults).keys() - dict(scenario.processes).keys()
        requests = [request for request in map(parse_fault, facts.faults) if request.what in untold]
        lift_off_s = phases.zero_s if phases.departed else None
        for request, fault in faults_asked(requests, history.events, lift_off_s, effects):
            yield FaultChange(request.what, request.how, fault.at_s), fault


def _died(facts: RunFacts, scenario: Scenario, observed: Observed, effects: EffectsByFault) -> Iterator[Known]:
    """Yield the processes that ended without being told to, but for those that a fault has ended."""
    nodes = dict(scenario.processes)
    ended = {nodes.get(change.sensor) for change in observed.processes}
    for death in facts.died:
        if death["when_s"] is not None and death["name"] not in ended:
            yield (
                FaultChange(death["name"], DIED, death["when_s"]),
                Fault(death["name"], death["when_s"], _until(death["again_s"]), effects.of(death["name"]), injected=False),
            )


def _until(again_s: float | None) -> float:
    return math.inf if again_s is None else again_s


def summarise_response(one: FaultResponse, phases: Phases) -> ResponseSummary:
    """Return a fault with the response to it for ``summary.json``."""
    fault = one.traced.fault
    return ResponseSummary(
        sensor=one.what,
        mode=one.mode,
        told=DIED if one.mode == DIED else fault.effects.told,
        injected=fault.injected,
        t_s=phases.since(fault.at_s),
        until_s=phases.since(fault.until_s) if math.isfinite(fault.until_s) else None,
        detected_s=phases.since(one.traced.detected_s),
        detected_by=one.traced.detected_by,
        failed=[failure.end.id for failure in one.traced.failures],
        answered_by=one.response.branch,
        skill=one.response.skill,
        after_s=None if one.after_s is None else round(one.after_s, 3),
    )
