"""A run as it was recorded: its events and how its mission ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from alula.common.record import FILE, RecordError, read_record
from alula.common.robots import RobotError, find_robot
from alula.common.run_log import account
from alula.common.runs import robot_of
from alula.records.errors import AnalysisError
from alula.records.logs import read_log
from alula.runtime.core.events import EngineEvent, TransitionEvent


def departure() -> tuple[str, str] | None:
    """Return resource and state of the ``departure`` of the robot that a command is about: times count from when it is left first."""
    try:
        return find_robot().departure
    except RobotError:
        return None


@dataclass(frozen=True)
class RecordedRun:
    """A run's events in their order; ``mission`` is the mission's account, empty where that is not known.

    ``departure``: resource and state of its robot's departure, None where its files tell of none.
    """

    path: Path
    events: Sequence[EngineEvent]
    mission: Mapping[str, Any] = field(default_factory=dict)
    departure: tuple[str, str] | None = None

    @property
    def outcome(self) -> str:
        """How the mission ended, empty where that is not known."""
        return str(self.mission.get("outcome", ""))

    @property
    def origin_s(self) -> float:
        """Lift-off, seconds of mission clock; the first event where nothing has lifted off.

        The mission's account tells it. The robot's departure counts only where there is no account of a mission that ended.
        """
        said = self.mission.get("lift_off_s")
        if isinstance(said, int | float):
            return float(said)
        if self.events and "lift_off_s" in self.mission and self.outcome not in {"", "running"}:
            return self.events[0].stamp_s
        return origin_of(self.events, self.departure)

    def time_s(self, event: EngineEvent) -> float:
        """Return when an event was, seconds since lift-off."""
        return event.stamp_s - self.origin_s


def lift_off_of(events: Sequence[EngineEvent], place: tuple[str, str] | None) -> float | None:
    """Return when a robot left the resource's state ``place`` first, seconds of mission clock; None: never."""
    left = (one for one in events if isinstance(one, TransitionEvent) and (one.resource, one.from_state) == place)
    return next((event.stamp_s for event in left), None)


def origin_of(events: Sequence[EngineEvent], place: tuple[str, str] | None) -> float:
    """Return the time that a run's times count from, seconds of mission clock."""
    lift_off_s = lift_off_of(events, place)
    if lift_off_s is not None:
        return lift_off_s
    return events[0].stamp_s if events else 0.0


def load_recorded_run(path: Path) -> RecordedRun:
    """Read a run's folder, or any log that ``read_log`` reads.

    Raises:
        AnalysisError: there is none, or it can't be read.
    """
    log = read_log(path)
    robot = robot_of(path)
    return RecordedRun(path, log.events, _mission(path), None if robot is None else robot.departure)


def _mission(path: Path) -> Mapping[str, Any]:
    folder = path if path.is_dir() else path.parent
    record = path if path.suffix == ".mcap" else folder / FILE
    try:
        return account(folder, read_record(record) if record.is_file() else [])
    except (OSError, ValueError, RecursionError, RecordError) as error:
        raise AnalysisError(f"{folder}: its mission can't be read: {error}") from None
