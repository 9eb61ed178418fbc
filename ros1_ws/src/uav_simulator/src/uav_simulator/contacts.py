"""Count contacts with the world and keep the least clearance, both from the vehicle's radius with propellers."""

from __future__ import annotations

import math

from uav_simulator.autopilot.types import LandedState
from uav_simulator.vehicle.rigid_body import RigidBody
from uav_simulator.world.scene import Nearest, Scene

CRUISE_HEIGHT_M = 2.0  # clearance counts once the take-off has ended or this height is reached
HARD_M_S = 2.0  # down; ArduCopter lands with at most 1.5 m/s
RELEASE_M = 0.05  # a contact ends at this distance, so that scraping along a wall is one contact


class ContactMonitor:
    """Watches one flight.

    Contact: something other than the ground nearer than the radius while not standing, or the ground nearer than that between
    the end of the take-off and the beginning of the landing, or met too fast at any time. Clearance counts in that same stretch of
    the flight, the ground included.
    """

    def __init__(self, world: Scene, radius_m: float) -> None:
        self._world, self._radius_m = world, radius_m
        self.collisions = 0
        self.min_clearance_m = math.inf
        self._touching = False
        self._cruising = False
        self._sink_m_s = 0.0

    def step(self, body: RigidBody, state: LandedState) -> None:
        """Look at the present moment; call at 50 Hz."""
        self._meet_the_ground(body)
        if state is LandedState.ON_GROUND:
            self._touching = self._cruising = False
            return
        if state is LandedState.IN_AIR or (state is LandedState.TAKING_OFF and body.position[2] >= CRUISE_HEIGHT_M):
            self._cruising = True
        if state is LandedState.LANDING:
            self._cruising = False
        obstacle = self._world.nearest_obstacle(body.position)
        clearance = obstacle.distance_m - self._radius_m
        if clearance < 0.0 and not body.on_ground:
            body.bounce(_away(body, obstacle), -clearance)
        if self._cruising:
            clearance = min(clearance, body.position[2] - self._radius_m)
            self.min_clearance_m = min(self.min_clearance_m, clearance)
        self._count(clearance)

    def _meet_the_ground(self, body: RigidBody) -> None:
        """Count a fall; an autopilot that restarts in the air says at once that it stands."""
        if body.position[2] > 0.0:
            self._sink_m_s = -body.velocity[2]
            return
        if self._sink_m_s > HARD_M_S and not self._touching:
            self.collisions += 1
            self._touching = True
        self._sink_m_s = 0.0

    def _count(self, clearance_m: float) -> None:
        if clearance_m < 0.0 and not self._touching:
            self.collisions += 1
            self._touching = True
        elif clearance_m > RELEASE_M:
            self._touching = False


def _away(body: RigidBody, nearest: Nearest) -> tuple[float, float, float]:
    """Return the unit vector from the nearest surface to the vehicle."""
    d = max(nearest.distance_m, 1e-6)
    x, y, z = ((p - q) / d for p, q in zip(body.position, nearest.point, strict=True))
    return x, y, z
