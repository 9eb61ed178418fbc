"""What a flight over mocks tells in place of a bag: no path, no map, but when what failed, and how fast it was."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TypedDict

from alula_common.faults import parse_fault
from alula_flight.report.facts import RunFacts
from alula_flight.report.files import Problems, finite, mapping, read_json, sequence
from alula_flight.report.recording import MENDED, FaultChange, Recording, SimulatorAccount
from run_analysis.causes.faults import RunTimes, faults_asked

MOCK = "mock"
"""The mode of what failed in mocks without a word for the way of failing."""


class MockSummary(TypedDict):
    """How long the flight took on the wall, and by what factor that was faster than the mission clock."""

    wall_s: float | None
    factor: float | None
    notes: list[str]


def read_mock(facts: RunFacts, ended_s: float | None, problems: Problems) -> tuple[Recording, MockSummary]:
    """Read ``mock.json``; ``ended_s``: when the run was over, seconds of mission clock."""
    values: dict[str, object] = {}
    with problems.survive("mock.json"):
        values = mapping(read_json(facts.out_dir / "mock.json"))
    account = SimulatorAccount(
        lift_off_s=finite(values.get("lift_off_s")),
        collisions=None,
        min_clearance_m=None,
        distance_m=None,
        faults=tuple(_changes(facts, values, ended_s)),
    )
    notes = [str(note) for note in sequence(values.get("notes"))]
    for note in notes:
        problems.note(f"mocks: {note}")
    return Recording(simulator=account), MockSummary(wall_s=finite(values.get("wall_s")), factor=finite(values.get("factor")), notes=notes)


def _changes(facts: RunFacts, values: Mapping[str, object], ended_s: float | None) -> Iterator[FaultChange]:
    """Yield what failed, and when it worked again.

    The file has when each fault came first; the requests have which of them came again, and when they ended.
    """
    faults = [mapping(entry) for entry in sequence(values.get("faults"))]
    told = {str(fault.get("sensor", "")): t_s for fault in faults if (t_s := finite(fault.get("t_s"))) is not None}
    requests = [request for request in map(parse_fault, facts.faults) if {request.what, f"{request.what}:{request.how}"} & told.keys()]
    last_s = max([*told.values(), *([] if ended_s is None else [ended_s])], default=0.0)
    asked = faults_asked(requests, RunTimes(0.0, finite(values.get("lift_off_s")), last_s), told)
    for request, fault in asked:
        yield FaultChange(request.what, request.how or MOCK, fault.at_s)
        if math.isfinite(fault.until_s) and fault.until_s <= last_s:
            yield FaultChange(request.what, MENDED, fault.until_s)
    named = {name for request in requests for name in (request.what, f"{request.what}:{request.how}")}
    yield from (FaultChange(name, MOCK, t_s) for name, t_s in told.items() if name not in named)
