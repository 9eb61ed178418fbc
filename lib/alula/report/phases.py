"""Find when a run's robot departed and when it was back."""

from __future__ import annotations

from dataclasses import dataclass

from alula.common.public import public
from alula.common.robots import RobotError, find_robot
from alula.report.history import History
from alula.report.observed import Observed
from alula.runtime.core.events import TransitionEvent


@public("alula.parts")
@dataclass(frozen=True)
class Phases:
    """Absolute seconds of mission clock. ``zero_s`` is the origin of all times of a report: the departure where it is known.

    ``zero_from`` names where it comes from: a robot's own recordings, the resource, first event, first record or nothing.
    """

    zero_s: float = 0.0
    zero_from: str = "nothing"
    departed: bool = False
    back_s: float | None = None

    def since(self, stamp_s: float | None) -> float | None:
        """Return seconds since the origin, to the millisecond."""
        return None if stamp_s is None else round(stamp_s - self.zero_s, 3)


def find_phases(history: History, observed: Observed) -> Phases:
    """Find them in the robot's own recordings, else in its resources."""
    zero_s, zero_from, departed = _origin(history, observed)
    return Phases(zero_s=zero_s, zero_from=zero_from, departed=departed, back_s=_back(history, observed, zero_s))


def home() -> tuple[str, str] | None:
    """Return the robot's state of departure: resource and state."""
    try:
        return find_robot().departure
    except RobotError:
        return None


def status_changes(history: History) -> list[TransitionEvent]:
    """Return the transitions of the resource whose state shows whether the robot is away."""
    place = home()
    return [] if place is None else [change for change in history.transitions if change.resource == place[0]]


def _origin(history: History, observed: Observed) -> tuple[float, str, bool]:
    if observed.departed_s is not None:
        return observed.departed_s, observed.departed_by, True
    place = home()
    for change in status_changes(history):
        if place is not None and change.from_state == place[1]:
            return change.stamp_s, change.resource, True
    if history.first_s is not None:
        return history.first_s, "first event", False
    if observed.first_s is not None:
        return observed.first_s, "first pose", False
    return 0.0, "nothing", False


def _back(history: History, observed: Observed, zero_s: float) -> float | None:
    place = home()
    changes = [change for change in status_changes(history) if change.stamp_s > zero_s]
    if changes and place is not None and changes[-1].to_state == place[1]:
        return changes[-1].stamp_s
    return observed.back_s if observed.back_s is not None and observed.back_s > zero_s else None
