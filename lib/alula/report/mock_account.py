"""What a run over mocks tells in place of recordings: when what failed, and how fast it was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

from alula.common.faults import FaultChange
from alula.report.files import Problems, finite, mapping, read_json, sequence
from alula.report.observed import Observed, fault_changes


class MockSummary(TypedDict):
    """How long the run took on the wall, and by what factor that was faster than the mission clock."""

    wall_s: float | None
    factor: float | None
    notes: list[str]


def read_mock(folder: Path, problems: Problems) -> tuple[Observed, MockSummary]:
    """Return what ``mock.json`` of a run over mocks says: lift-off and faults, and how fast it ran."""
    values: dict[str, object] = {}
    with problems.survive("mock.json"):
        values = mapping(read_json(folder / "mock.json"))
    observed = Observed(
        departed_s=finite(values.get("lift_off_s")),
        departed_by="simulator",
        faults=tuple(_changes(values.get("faults"))),
        tells_faults=True,
    )
    notes = [str(note) for note in sequence(values.get("notes"))]
    for note in notes:
        problems.note(f"mocks: {note}")
    return observed, MockSummary(wall_s=finite(values.get("wall_s")), factor=finite(values.get("factor")), notes=notes)


def _changes(value: object) -> Iterator[FaultChange]:
    """Yield what failed and what worked again; older files have the first time of each alone, with the way in its name: ``zed:dark``."""
    for change in fault_changes(value):
        sensor, _, mode = change.sensor.partition(":")
        yield replace(change, sensor=sensor, mode=mode or change.mode)
