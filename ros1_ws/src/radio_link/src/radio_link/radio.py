"""The whole radio: both directions, several flows in each, and what decides how good it is now. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from alula.common.faults import FaultRequest
from radio_link.channel import Channel
from radio_link.conditions import PRESETS, Both, Quality
from radio_link.laws import Point
from uav_simulator.world.radio import RadioZone, radio_zone_at

FAULTS: dict[str, tuple[str, ...]] = {
    "radio": (Quality.CRITICAL.value, Quality.DEGRADED.value, Quality.OUT.value),
    "control": ("lost",),
}
"""What of the radio can fail, each with the ways in which it can; the first one counts where none is named."""


@dataclass(frozen=True)
class Situation:
    """How good the radio is, and why."""

    both: Both
    quality: Quality
    cause: str


Place = Callable[[Point | None], Situation]


def by_zones(zones: Iterable[RadioZone]) -> Place:
    """Return a function from a place to the quality of the radio, by the zones of a world; outside of all the radio is good."""
    known = tuple(zones)

    def look(point: Point | None) -> Situation:
        zone = None if point is None else radio_zone_at(known, point)
        quality = Quality.GOOD if zone is None else Quality(zone.quality.value)
        return Situation(PRESETS[quality], quality, "" if zone is None else zone.name)

    return look


class Radio:
    """Carries datagrams of numbered flows. ``place``: how good the radio is at the vehicle's place, None while that is not known.

    Times of faults count from lift-off on the mission clock.
    """

    def __init__(self, place: Place, faults: Sequence[FaultRequest] = (), *, seed: int = 0) -> None:
        self._place = place
        self._faults = tuple(faults)
        self.situation = place(None)
        self.down, self.up = Channel(self.situation.both.down, 2 * seed), Channel(self.situation.both.up, 2 * seed + 1)
        self.control_lost = False

    def look(self, point: Point | None, since_lift_off_s: float | None) -> None:
        """Update the quality by the vehicle's place and the time."""
        situation = self._place(point)
        active = [fault for fault in self._faults if fault.lasts(since_lift_off_s)]
        self.control_lost = any(fault.what == "control" for fault in active)
        for fault in active:
            quality = Quality(fault.how or FAULTS["radio"][0]) if fault.what == "radio" else situation.quality
            if quality.rank > situation.quality.rank:
                situation = Situation(PRESETS[quality], quality, f"fault {fault}")
        self.situation = situation
        self.down.condition, self.up.condition = situation.both.down, situation.both.up
