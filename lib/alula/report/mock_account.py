"""Read what a run over mocks notes in place of recordings: its faults with their times, and its speed."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

from alula.common import run_log
from alula.report.files import Problems, finite, mapping, sequence
from alula.report.observed import Observed, read_faults


class MockSummary(TypedDict):
    """How long the run took on the wall, and by what factor that was faster than the mission clock."""

    wall_s: float | None
    factor: float | None
    notes: list[str]


def read_mock(folder: Path, problems: Problems) -> tuple[Observed, MockSummary]:
    """Return the faults of a run over mocks, and its speed."""
    told = run_log.read(folder, run_log.MOCKED)
    if not told:
        problems.note(f"{run_log.FILE} does not say how the mocks ran")
    values = mapping(told[-1] if told else {})
    notes = [str(note) for note in sequence(values.get("notes"))]
    for note in notes:
        problems.note(f"mocks: {note}")
    observed = Observed(faults=read_faults(folder), tells_faults=True)
    return observed, MockSummary(wall_s=finite(values.get("wall_s")), factor=finite(values.get("factor")), notes=notes)
