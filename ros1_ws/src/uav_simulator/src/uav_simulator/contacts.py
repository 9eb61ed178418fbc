"""Count contacts with the world and keep the least clearance, both from the vehicle's radius with propellers; tell crash from landing."""

from __future__ import annotations

import math

from uav_simulator.autopilot.types import LandedState
from uav_simulator.frames import Vec3
from uav_simulator.vehicle.rigid_body import ZERO, RigidBody
from uav_simulator.world.scene import Nearest, Scene

CRUISE_HEIGHT_M = 2.0  # clearance counts once the take-off has ended or this height is reached
HARD_M_S = 3.0  # down; ArduCopter lands with 0.5 m/s, a pilot's throttle at zero brings it down with 2.5 (PILOT_SPEED_UP)
LEANING_RAD = math.radians(45.0)  # more than any slope that a multicopter lands on
RELEASE_M = 0.05  # a contact ends at this distance, so that scraping along a wall is one contact
ROUNDING_M = 1e-3  # of distances between points in float32


class ContactMonitor:
    """Watches one flight.

    Contact: something other than the ground nearer than the radius while not standing, or the ground nearer than that between
    the end of the take-off and the beginning of the landing, or met too fast at any time. Clearance counts in that same stretch of
    the flight, the ground included. Crash: how the vehicle crashed first, empty as long as it has not: it met the ground too
    fast, or leaning, or it touched something while it landed.
    """

    def __init__(self, world: Scene, radius_m: float) -> None:
        self._world, self._radius_m = world, radius_m
        self.collisions = 0
        self.min_clearance_m = math.inf
        self.crash = ""
        self._touching = False
        self._cruising = False
        self._sink_m_s = self._lean_rad = 0.0
        self._looked_from: Vec3 | None = None  # with what was seen there
        self._seen = Nearest(math.inf, ZERO)

    def step(self, body: RigidBody, state: LandedState) -> None:
        """Check the present moment; call at 50 Hz."""
        self._meet_the_ground(body)
        if state is LandedState.ON_GROUND:
            self._touching = self._cruising = False
            return
        if state is LandedState.IN_AIR or (state is LandedState.TAKING_OFF and body.position[2] >= CRUISE_HEIGHT_M):
            self._cruising = True
        if state is LandedState.LANDING:
            self._cruising = False
        obstacle = self._nearest_obstacle(body.position)
        clearance = obstacle.distance_m - self._radius_m
        if clearance < 0.0 and not body.on_ground:
            body.bounce(_away(body, obstacle), -clearance)
            if state is LandedState.LANDING:
                self._crashed(f"it touched something on its way down, {body.position[2]:.1f} m above the ground")
        if self._cruising:
            clearance = min(clearance, body.position[2] - self._radius_m)
            self.min_clearance_m = min(self.min_clearance_m, clearance)
        self._count(clearance)

    def _nearest_obstacle(self, position: Vec3) -> Nearest:
        """Return the nearest obstacle, or one that is no farther, where neither can be a contact or the least clearance.

        Nothing comes nearer than by what the vehicle has moved since the last look, which is mostly less than there is room for.
        """
        if self._looked_from is not None:
            least_m = self._seen.distance_m - math.dist(position, self._looked_from) - ROUNDING_M
            if least_m - self._radius_m > max(RELEASE_M, min(self.min_clearance_m, position[2] - self._radius_m)):
                return Nearest(least_m, self._seen.point)
        self._looked_from, self._seen = position, self._world.nearest_obstacle(position)
        return self._seen

    def _meet_the_ground(self, body: RigidBody) -> None:
        """Count a fall; an autopilot that restarts in the air says at once that it stands."""
        if body.position[2] > 0.0:
            self._sink_m_s, self._lean_rad = -body.velocity[2], _lean_rad(body)
            return
        if self._sink_m_s > HARD_M_S:
            self._crashed(f"it met the ground at {self._sink_m_s:.1f} m/s")
        elif self._lean_rad > LEANING_RAD:
            self._crashed(f"it met the ground leaning by {math.degrees(self._lean_rad):.0f} degrees")
        if max(self._sink_m_s / HARD_M_S, self._lean_rad / LEANING_RAD) > 1.0 and not self._touching:
            self.collisions += 1
            self._touching = True
        self._sink_m_s = self._lean_rad = 0.0

    def _crashed(self, how: str) -> None:
        self.crash = self.crash or how

    def _count(self, clearance_m: float) -> None:
        if clearance_m < 0.0 and not self._touching:
            self.collisions += 1
            self._touching = True
        elif clearance_m > RELEASE_M:
            self._touching = False


def _lean_rad(body: RigidBody) -> float:
    """Return by how much the body's upward axis leans, 0 to pi."""
    _, x, y, _ = body.attitude
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))


def _away(body: RigidBody, nearest: Nearest) -> tuple[float, float, float]:
    """Return the unit vector from the nearest surface to the vehicle."""
    d = max(nearest.distance_m, 1e-6)
    x, y, z = ((p - q) / d for p, q in zip(body.position, nearest.point, strict=True))
    return x, y, z
