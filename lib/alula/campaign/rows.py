"""Runs the missions of a campaign, in any process, and makes a row of each; a row holds nothing that depends on machine or date."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alula.campaign.failures import FAULT, PROCESS, Failure, Way, as_dict, failures_by, failures_in, name_of, ways_to_fail
from alula.campaign.flown import FlownResponse
from alula.campaign.live import run_live
from alula.campaign.mocked_scenarios import MockedScenario, load_mocked_scenario
from alula.campaign.plan import SIMULATOR, PlannedRun
from alula.common.operator import is_operator
from alula.common.record import RecordError, read_record
from alula.common.robots import find_robot
from alula.mock import Behaviour
from alula.records.causes.effects import EffectsByFault
from alula.records.causes.fault_file import effects_of_robot
from alula.records.causes.faults import Fault, faults_asked, trace
from alula.records.causes.told_ends import with_told_ends
from alula.records.conformance import Monitor
from alula.records.errors import AnalysisError
from alula.records.models import models_of
from alula.records.run import RecordedRun, departure, lift_off_of, load_recorded_run, origin_of
from alula.records.tree import Places, places_in
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent

Row = dict[str, Any]
OBEYED = "the operator's act"
"""The response to what is no failure: the operator pauses or aborts the mission."""


def rows_of(runs: Sequence[PlannedRun], over: str, behaviour: tuple[str, ...], out: str, options: tuple[str, ...] = ()) -> list[Row]:
    """Do runs one after another; return one row of the table for each. Live runs leave their folders in the campaign's folder ``out``."""
    if over == SIMULATOR:
        return [_simulated(planned, options, Path(out)) for planned in runs]
    return [_mocked(planned, behaviour) for planned in runs]


@functools.cache
def _scenario(name: str, behaviour: tuple[str, ...]) -> tuple[MockedScenario, list[Way]]:
    scenario = load_mocked_scenario(name, tuple(map(Path, behaviour)))
    return scenario, ways_to_fail(scenario.skillsets)


def _mocked(planned: PlannedRun, behaviour: tuple[str, ...]) -> Row:
    scenario, ways = _scenario(planned.scenario, behaviour)
    mocked = scenario.run(planned.requests, planned.seed)
    monitor = Monitor(scenario.skillsets)
    landed = came_back(mocked.events)
    found = {"outcome": mocked.end.outcome.value, "reason": mocked.end.reason, "landed": landed, "open": list(mocked.open)}
    found |= {"problems": list(mocked.notes), "collisions": None, "min_clearance_m": None, "died": [], "exit_code": None}
    left = _Evidence(mocked.events, mocked.places, first_s=mocked.faults, behaviour=scenario.behaviour, responses=mocked.responses)
    return _row(planned, found, left, monitor, ways)


def came_back(events: Sequence[EngineEvent]) -> bool | None:
    """Return whether the robot came back to its state of departure; None where it never left it, or the mission need not bring it back.

    Others have to when it was taken from the mission while it was away; nobody has to when it rests where it may be left.
    """
    robot = find_robot()
    resource, home = robot.departure or ("", "")
    states: dict[str, str] = {}
    taken = False
    for event in events:
        if isinstance(event, TransitionEvent):
            states[event.resource] = event.to_state
            taken = taken or (states.get(resource, home) != home and (event.resource, event.to_state) == robot.taken)
    if resource not in states:
        return None
    rests = robot.rest is not None and states.get(robot.rest[0]) == robot.rest[1]
    return states[resource] == home or (None if taken or rests else False)


@dataclass(frozen=True)
class _Evidence:
    """The events and facts that a run has left.

    Attributes:
        events: of its managers.
        places: where in the tree executions were started.
        known: the events, and the ends that only the mission was told of; None: there are none of these.
        first_s: when mocks say that each fault came first.
        behaviour: of the mocks.
        responses: what the tree did about each failure that it saw; live runs don't tell.
    """

    events: Sequence[EngineEvent]
    places: Places
    known: Sequence[EngineEvent] | None = None
    first_s: Mapping[str, float] | None = None
    behaviour: Behaviour | None = None
    responses: Sequence[FlownResponse] = ()


def _row(planned: PlannedRun, found: Mapping[str, Any], left: _Evidence, monitor: Monitor, ways: Sequence[Way]) -> Row:
    """Return a row; ``found`` is how the run went besides its events."""
    for event in left.events:
        monitor.take(event)
    events = left.events if left.known is None else left.known
    origin_s = origin_of(events, departure())
    effects = effects_of_robot()
    asked = faults_asked(
        planned.requests, events, lift_off_of(events, departure()), effects, first_s=left.first_s, behaviour=left.behaviour
    )
    begun = [(Way(FAULT, name_of(request)), fault) for request, fault in asked if not is_operator(request)]
    died = [(Way(PROCESS, one["name"]), _ended(one, events, effects)) for one in found["died"]]
    every = [failure for causes in (begun, died) for failure in failures_by(causes, events, left.places)]
    every += [Failure(Way(FAULT, name_of(request)), fault.at_s, OBEYED) for request, fault in asked if is_operator(request)]
    every += failures_in(events, ways, left.places)
    return {
        "run": planned.number,
        "scenario": planned.scenario,
        "seed": planned.seed,
        "faults": list(planned.faults),
        **found,
        "duration_s": round(events[-1].stamp_s - events[0].stamp_s, 6) if events else 0.0,
        "events": len(left.events),
        "conforms": monitor.verdict.conforms,
        "failures": [as_dict(failure, origin_s) for failure in every],
        "answers": _responses(left.responses, events, [fault for _, fault in asked], origin_s),
    }


def _responses(responses: Sequence[FlownResponse], events: Sequence[EngineEvent], faults: Sequence[Fault], origin_s: float) -> list[Row]:
    """Return the responses to failures, each with when it failed, and the fault of the run that it follows from, if any."""
    causes = {failure.end.id: traced.fault.name for traced in trace(faults, events) for failure in traced.failures}
    ended_s = {event.id: event.stamp_s for event in events if isinstance(event, ExecutionEvent) and event.state.terminal}
    return [
        {**one.as_dict(), "at_s": round(ended_s.get(one.id, origin_s) - origin_s, 6), "fault": causes.get(one.id, "")} for one in responses
    ]


def _ended(died: Mapping[str, Any], events: Sequence[EngineEvent], effects: EffectsByFault) -> Fault:
    """Return the end of a process, as in the summary, as a fault; without a time it ended before the mission clock ran."""
    begun_s = min((event.stamp_s for event in events), default=0.0)
    at_s = begun_s if died["when_s"] is None else origin_of(events, departure()) + died["when_s"]
    until_s = math.inf if died.get("again_s") is None else origin_of(events, departure()) + died["again_s"]
    return Fault(died["name"], at_s, until_s, effects.of(died["name"]))


# --- in the simulator ---------------------------------------------------------------------------------------------------


def _simulated(planned: PlannedRun, options: Sequence[str], out: Path) -> Row:
    """Run by the command line, as a user does; keep the run's folder."""
    folder, done = run_live(planned, options, out)
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        said = (done.stderr.strip() or done.stdout.strip()).splitlines()
        summary = {"outcome": "not_started", "reason": said[-1] if said else ""}
    try:
        run, record = load_recorded_run(folder), read_record(folder)
    except (AnalysisError, RecordError):  # no skill was ever started
        run, record = RecordedRun(folder, ()), []
    names = dict.fromkeys(event.skillset for event in run.events)
    ended = {one["id"] for one in summary.get("skills") or () if one.get("end_s") is not None}
    found = {name: summary.get(name) for name in ("outcome", "reason", "landed", "collisions", "min_clearance_m")}
    if found["landed"] is False and came_back(run.events) is None:
        found["landed"] = None
    found |= {"open": [one["id"] for one in summary.get("skills") or () if one["id"] not in ended]}
    found |= {"problems": summary.get("problems") or [], "died": summary.get("died") or [], "exit_code": done.returncode}
    found["folder"] = folder.name
    models = models_of(names)
    left = _Evidence(run.events, places_in(record), with_told_ends(run.events, record))
    return _row(planned, found, left, Monitor(models), ways_to_fail(models))
