"""Observations of a run besides the events of its skillsets: from the robot's recordings, the supervisor, or mocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from alula.common.faults import FaultChange
from alula.common.run_log import FAULT, read
from alula.report.files import finite, mapping, sequence


@dataclass(frozen=True)
class Observed:
    """Times are absolute seconds of mission clock.

    Attributes:
        departed_s: when the robot departed, by ``departed_by``, where something but the skillsets tells it.
        first_s: when the recordings begin; ``last_s``: when they end.
        back_s: when it was back in its state of departure, where something but the skillsets tells it.
        is_back: whether it was said to be there last; None: not said.
        faults: what a simulator or mocks broke and mended; ``tells_faults``: they tell all of them.
        processes: what the supervisor did to processes.
        moving_again: returns when the robot moves again from a time on, None: never; None where its motion is not known.
    """

    departed_s: float | None = None
    departed_by: str = ""
    first_s: float | None = None
    last_s: float | None = None
    back_s: float | None = None
    is_back: bool | None = None
    faults: tuple[FaultChange, ...] = ()
    tells_faults: bool = False
    processes: tuple[FaultChange, ...] = ()
    moving_again: Callable[[float], float | None] | None = None

    @property
    def all_faults(self) -> tuple[FaultChange, ...]:
        """All starts and ends of faults, in the order of time."""
        return tuple(sorted((*self.faults, *self.processes), key=lambda change: change.t_s))


def read_faults(folder: Path) -> tuple[FaultChange, ...]:
    """Return what the supervisor did to processes; of a run over mocks, all that was made to fail."""
    return tuple(fault_changes(read(folder, FAULT)))


def fault_changes(value: object) -> Iterator[FaultChange]:
    """Yield the starts and ends of faults as they were written; entries that make no sense are left out."""
    for entry in sequence(value):
        values = mapping(entry)
        t_s = finite(values.get("t_s"))
        if t_s is not None:
            yield FaultChange(str(values.get("sensor", "")), str(values.get("mode", "")), t_s)
