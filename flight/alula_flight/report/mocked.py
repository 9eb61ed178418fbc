"""What a flight over mocks tells in place of a bag: no path, no map, but when what failed, and how fast it was."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

from alula_flight.report.files import Problems, finite, mapping, read_json, sequence
from alula_flight.report.recording import FaultChange, Recording, SimulatorAccount


class MockSummary(TypedDict):
    """How long the flight took on the wall, and by what factor that was faster than the mission clock."""

    wall_s: float | None
    factor: float | None
    notes: list[str]


def read_mock(folder: Path, problems: Problems) -> tuple[Recording, MockSummary]:
    """Read ``mock.json``."""
    values: dict[str, object] = {}
    with problems.survive("mock.json"):
        values = mapping(read_json(folder / "mock.json"))
    faults = [mapping(entry) for entry in sequence(values.get("faults"))]
    account = SimulatorAccount(
        lift_off_s=finite(values.get("lift_off_s")),
        collisions=None,
        min_clearance_m=None,
        distance_m=None,
        faults=tuple(
            FaultChange(str(fault.get("sensor", "")), str(fault.get("mode", "")), t_s)
            for fault in faults
            if (t_s := finite(fault.get("t_s"))) is not None
        ),
    )
    notes = [str(note) for note in sequence(values.get("notes"))]
    for note in notes:
        problems.note(f"mocks: {note}")
    return Recording(simulator=account), MockSummary(wall_s=finite(values.get("wall_s")), factor=finite(values.get("factor")), notes=notes)
