"""When a flight began to cruise, began to land and touched down, by the skills and the guidance's states."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile

from alula.report.history import History
from alula.report.phases import Phases
from uav_report.recording import ON_GROUND, GuidanceAccount

TAKEOFF = "takeoff"
LAND = "land"
_BEFORE_FLIGHT = {"takeoff", "idle", ""}


@dataclass(frozen=True)
class FlightPhases(Phases):
    """Absolute seconds of mission clock. ``cruise_s``: the take-off is over."""

    cruise_s: float | None = None
    landing_s: float | None = None

    @property
    def lifted_off(self) -> bool:
        """Return whether the vehicle is known to have left the ground."""
        return self.departed

    @property
    def touch_down_s(self) -> float | None:
        """When it stood on the ground again."""
        return self.back_s


def flight_phases(phases: Phases, history: History, guidance: tuple[GuidanceAccount, ...]) -> FlightPhases:
    """Return the phases of a flight: departure and return are the report's."""
    cruise_s, landing_s = _cruise(history, guidance, phases.zero_s), _landing(history, guidance, phases.zero_s)
    return FlightPhases(phases.zero_s, phases.zero_from, phases.departed, phases.back_s, cruise_s, landing_s)


def touch_down(guidance: tuple[GuidanceAccount, ...]) -> float | None:
    """Return when the guidance last reported that the vehicle stands again after it had flown; None: it did not."""
    block = list(takewhile(lambda state: state.landed_state == ON_GROUND, reversed(guidance)))
    return block[-1].t_s if 0 < len(block) < len(guidance) else None


def _cruise(history: History, guidance: tuple[GuidanceAccount, ...], zero_s: float) -> float | None:
    ends = [execution.ended_s for execution in history.of_skill(TAKEOFF) if execution.ended_s is not None and execution.ended_s > zero_s]
    if ends:
        return ends[0]
    return next((state.t_s for state in guidance if state.t_s > zero_s and state.reference not in _BEFORE_FLIGHT), None)


def _landing(history: History, guidance: tuple[GuidanceAccount, ...], zero_s: float) -> float | None:
    """Return the beginning of the last landing: a landing that was broken off is flight like any other."""
    last = next((index for index in reversed(range(len(guidance))) if guidance[index].landing), None)
    if last is not None:
        block = list(takewhile(lambda state: state.landing, reversed(guidance[: last + 1])))
        return block[-1].t_s
    starts = [execution.started_s for execution in history.of_skill(LAND) if execution.started_s is not None]
    return starts[-1] if starts and starts[-1] > zero_s else None
