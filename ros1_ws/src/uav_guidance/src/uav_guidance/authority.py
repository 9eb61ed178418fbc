"""The authority over the vehicle: the companion has it as long as the mode is its own, and never against the pilot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

from uav_guidance.vehicle import Mode, VehicleSnapshot

START_AGAIN_S = 5.0  # after GUIDED was refused at the start


class AuthorityChange(Enum):
    """How the authority changed at an update."""

    NONE = auto()
    GAINED = auto()
    LOST = auto()


@dataclass
class Authority:
    """The companion has authority in GUIDED, and in LAND if it asked for that itself; any other mode is the pilot's or a failsafe's."""

    held: bool = False
    mode_told: bool = False
    """Whether a heartbeat has had the mode since the link is up."""
    _land_asked: bool = False
    _land_seen: bool = False
    _start_settled: bool = False
    _start_refused_s: float = -math.inf
    _flown: bool = False

    def ask_land(self) -> None:
        """Record that the companion requests LAND, before it does; a LAND received before belongs to another landing."""
        self._land_asked, self._land_seen = True, False

    @property
    def landing_unseen(self) -> bool:
        """Whether LAND was requested, and no heartbeat has shown it yet: the mode received last may be past."""
        return self._land_asked and not self._land_seen

    def withdraw_land(self) -> None:
        """Record that the autopilot refused to land, or got another command since: a later LAND is the pilot's or a failsafe's."""
        if self.landing_unseen:
            self._land_asked = False

    def hear_heartbeat(self, vehicle: VehicleSnapshot) -> None:
        """Record that the vehicle's mode was received just now."""
        self.mode_told = True
        self._land_seen |= self._land_asked and vehicle.mode == Mode.LAND

    def update(self, vehicle: VehicleSnapshot, *, link: bool) -> AuthorityChange:
        """Judge by the mode of the last heartbeat; ``link``: it is up. After an interruption it counts from the next heartbeat on."""
        self.mode_told &= link
        self._flown |= vehicle.off_ground
        if vehicle.mode not in {Mode.GUIDED, Mode.LAND} or (self._land_seen and vehicle.mode != Mode.LAND):
            self._land_asked = self._land_seen = False
        before = self.held
        ours = vehicle.mode == Mode.GUIDED or (vehicle.mode == Mode.LAND and self._land_asked)
        self.held = self.mode_told and not vehicle.foreign and ours
        if self.held == before:
            return AuthorityChange.NONE
        return AuthorityChange.GAINED if self.held else AuthorityChange.LOST

    def wants_start(self, vehicle: VehicleSnapshot, now_s: float) -> bool:
        """Return whether to take GUIDED now, once after a start of the node or the autopilot: ready, on the ground, not flown before."""
        if self._start_settled or not self.mode_told or vehicle.foreign or abs(now_s - self._start_refused_s) < START_AGAIN_S:
            return False
        if vehicle.armed or self.held or vehicle.off_ground:
            self._start_settled = True
        return not self._start_settled and vehicle.ready and vehicle.on_ground

    def start_over(self) -> None:
        """Record that the autopilot has restarted: GUIDED may be taken again, unless the vehicle has flown."""
        self._start_settled = self._flown

    def settle_start(self) -> None:
        """Record that GUIDED was taken."""
        self._start_settled = True

    def start_refused(self, now_s: float) -> None:
        """Record that the autopilot refused GUIDED: it is requested again a little later."""
        self._start_refused_s = now_s
