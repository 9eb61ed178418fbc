"""Whether the authority is of use: the autopilot can fly, and its places are still those of the mission."""

from __future__ import annotations

from dataclasses import dataclass

from uav_guidance.vehicle import VehicleSnapshot

CHECKS_S = 1.5  # from a change of mode until SYS_STATUS tells what it did to the autopilot's checks, which run once a second


@dataclass
class Readiness:
    """Ready: with a position, and its checks passed in GUIDED, or armed already. Checks that fail again on the ground take nothing away."""

    restarted: bool = False
    """The autopilot has restarted in flight: its places may be others now."""
    _been_ready: bool = False
    _checks_passed: bool = False
    _changed_s: float = 0.0

    @property
    def usable(self) -> bool:
        """Whether skills can fly with the authority, where it is held."""
        return self._been_ready and not self.restarted

    def authority_changed(self, now_s: float) -> None:
        """Record that the authority was gained or lost: earlier checks are no promise, for GUIDED alone needs a position."""
        self._changed_s, self._checks_passed = now_s, False

    def hear_checks(self, vehicle: VehicleSnapshot, now_s: float, *, held: bool) -> None:
        """Handle a new SYS_STATUS; ``held``: the companion has the authority."""
        self._checks_passed = vehicle.ready and held and abs(now_s - self._changed_s) >= CHECKS_S

    def update(self, vehicle: VehicleSnapshot, *, held: bool) -> None:
        """Judge the present state; ``held``: the companion has the authority."""
        able = vehicle.located and (self._checks_passed or vehicle.armed or vehicle.off_ground)
        self._been_ready = held and (self._been_ready or able)
        self.restarted &= not (vehicle.on_ground and not vehicle.armed)

    def start_over(self) -> None:
        """Record that the autopilot has restarted."""
        self.restarted = True
        self._been_ready = self._checks_passed = False
