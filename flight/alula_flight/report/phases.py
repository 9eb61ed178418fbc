"""When a flight left the ground, began to fly, began to land and touched down, from the records that tell it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile

from alula.runtime.core.events import TransitionEvent
from alula_flight.report.events import History
from alula_flight.report.recording import ON_GROUND, GuidanceAccount, Recording

FLIGHT_STATUS = "flight_status"
TAKEOFF = "takeoff"
LAND = "land"
_BEFORE_FLIGHT = {"takeoff", "idle", ""}


@dataclass(frozen=True)
class Phases:
    """Absolute seconds of mission clock. ``zero_s`` is the origin of all times of a report: lift-off where it is known.

    ``zero_from`` names what told it: simulator, flight_status, first event, first pose or nothing. ``cruise_s``: the take-off is over.
    """

    zero_s: float = 0.0
    zero_from: str = "nothing"
    cruise_s: float | None = None
    landing_s: float | None = None
    touch_down_s: float | None = None

    @property
    def lifted_off(self) -> bool:
        """Tell whether the vehicle is known to have left the ground."""
        return self.zero_from in {"simulator", FLIGHT_STATUS}

    def since(self, stamp_s: float | None) -> float | None:
        """Return seconds since lift-off, to the millisecond."""
        return None if stamp_s is None else round(stamp_s - self.zero_s, 3)


def find_phases(history: History, recording: Recording) -> Phases:
    """Ask the simulator, then the resources, then the guidance."""
    zero_s, zero_from = _origin(history, recording)
    return Phases(
        zero_s=zero_s,
        zero_from=zero_from,
        cruise_s=_cruise(history, recording.guidance, zero_s),
        landing_s=_landing(history, recording.guidance, zero_s),
        touch_down_s=_touch_down(history, recording.guidance, zero_s),
    )


def _origin(history: History, recording: Recording) -> tuple[float, str]:
    if recording.simulator is not None and recording.simulator.lift_off_s is not None:
        return recording.simulator.lift_off_s, "simulator"
    for transition in flight_status(history):
        if transition.from_state == "ON_GROUND":
            return transition.stamp_s, FLIGHT_STATUS
    if history.first_s is not None:
        return history.first_s, "first event"
    if recording.path is not None:
        return float(recording.path.t_s[0]), "first pose"
    return 0.0, "nothing"


def flight_status(history: History) -> list[TransitionEvent]:
    """Return the transitions between ON_GROUND and IN_AIR."""
    return [transition for transition in history.transitions if transition.resource == FLIGHT_STATUS]


def _cruise(history: History, guidance: tuple[GuidanceAccount, ...], zero_s: float) -> float | None:
    ends = [execution.end_s for execution in history.of_skill(TAKEOFF) if execution.end_s is not None and execution.end_s > zero_s]
    if ends:
        return ends[0]
    return next((state.t_s for state in guidance if state.t_s > zero_s and state.reference not in _BEFORE_FLIGHT), None)


def _landing(history: History, guidance: tuple[GuidanceAccount, ...], zero_s: float) -> float | None:
    """Return the beginning of the last landing: a landing that was broken off is flight like any other."""
    last = next((index for index in reversed(range(len(guidance))) if guidance[index].landing), None)
    if last is not None:
        block = list(takewhile(lambda state: state.landing, reversed(guidance[: last + 1])))
        return block[-1].t_s
    starts = [execution.running_s for execution in history.of_skill(LAND) if execution.running_s is not None]
    return starts[-1] if starts and starts[-1] > zero_s else None


def _touch_down(history: History, guidance: tuple[GuidanceAccount, ...], zero_s: float) -> float | None:
    changes = [change for change in flight_status(history) if change.stamp_s > zero_s]
    if changes and changes[-1].to_state == "ON_GROUND":
        return changes[-1].stamp_s
    block = list(takewhile(lambda state: state.landed_state == ON_GROUND and state.t_s > zero_s, reversed(guidance)))
    return block[-1].t_s if block else None
