"""The authority over the vehicle: the companion has it as long as the mode is its own, and never against the pilot."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from uav_guidance.vehicle import Mode, Vehicle


class Change(Enum):
    """What happened to the authority at an update."""

    NONE = auto()
    GAINED = auto()
    LOST = auto()


@dataclass
class Authority:
    """The companion has authority in GUIDED, and in LAND if it asked for that itself; any other mode is the pilot's or a failsafe's."""

    held: bool = False
    _land_asked: bool = False
    _land_seen: bool = False
    _start_settled: bool = False
    _flown: bool = False

    def ask_land(self) -> None:
        """Note that the companion itself asks for LAND, before it does."""
        self._land_asked = True

    def land_refused(self) -> None:
        """Note that the autopilot did not agree to land."""
        self._land_asked = False

    def update(self, vehicle: Vehicle, *, link: bool) -> Change:
        """Judge by the mode of the last heartbeat; ``link``: it holds."""
        self._flown |= vehicle.off_ground
        self._land_seen |= self._land_asked and vehicle.mode == Mode.LAND
        if vehicle.mode not in {Mode.GUIDED, Mode.LAND} or (self._land_seen and vehicle.mode != Mode.LAND):
            self._land_asked = self._land_seen = False
        before = self.held
        self.held = link and (vehicle.mode == Mode.GUIDED or (vehicle.mode == Mode.LAND and self._land_asked))
        if self.held == before:
            return Change.NONE
        return Change.GAINED if self.held else Change.LOST

    def wants_start(self, vehicle: Vehicle, *, link: bool) -> bool:
        """Return whether to take GUIDED now, once after a start of the node or the autopilot: ready, on the ground, not flown before."""
        if self._start_settled or not link:
            return False
        if vehicle.armed or self.held or vehicle.off_ground:
            self._start_settled = True
        return not self._start_settled and vehicle.ready and vehicle.on_ground

    def start_over(self) -> None:
        """Note that the autopilot has restarted: GUIDED may be taken again, unless the vehicle has flown."""
        self._start_settled = self._flown

    def settle_start(self) -> None:
        """Note that GUIDED was asked for, and answered."""
        self._start_settled = True
