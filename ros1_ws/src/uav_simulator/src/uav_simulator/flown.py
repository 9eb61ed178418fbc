"""What flies in a simulation: a body, moved by one tick at a time by its pilot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from uav_simulator.autopilot.core import Autopilot
from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.autopilot.estimator import PERFECT, Estimator
from uav_simulator.autopilot.types import LandedState, Mode
from uav_simulator.frames import Vec3
from uav_simulator.imperfections import Imperfections
from uav_simulator.sensors.faults import SensorMode
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.hexacopter import Hexacopter
from uav_simulator.vehicle.noise import Wind
from uav_simulator.vehicle.rigid_body import ZERO, RigidBody

TAKEN = {SensorMode.TAKES: Mode.LOITER, SensorMode.LANDS: Mode.LAND}
"""The modes in which the pilot has the vehicle."""
STICK_RAD_S = 0.5
"""How fast the pilot turns the nose where the stick is moved."""


class Flown(Protocol):
    """A vehicle and its pilot."""

    @property
    def body(self) -> RigidBody:
        """The rigid body in the simulated world."""

    @property
    def estimator(self) -> Estimator | None:
        """The autopilot's estimator of its place; None: the autopilot is not the simulator's, and its estimator can't be changed."""

    @property
    def landed_state(self) -> LandedState:
        """Whether it stands, climbs, flies or lands."""

    def tick(self, now_s: float, dt_s: float) -> bool:
        """Advance by one tick that ends at ``now_s``; False: its autopilot has not come so far yet, call again."""

    def late_s(self, now_s: float) -> float:
        """Return how far its autopilot has gone on beyond this moment; 0 where it waits for the simulation."""

    def expose(self, wind: SensorMode, pilot: SensorMode) -> None:
        """Apply the faults of wind and pilot; called each tick. Nothing happens where another autopilot flies."""


class SimulatedAutopilotVehicle:
    """The hexacopter, flown by the simulator's own autopilot behind MAVLink."""

    def __init__(
        self,
        *,
        seed: int,
        home: Vec3 = ZERO,
        boot_before_s: float = 60.0,
        params: Mapping[str, float] | None = None,
        ground_link: bool = False,
        imperfections: Imperfections = PERFECT,
    ) -> None:
        """``params`` of the autopilot; ``ground_link``: a ground station speaks over a link of its own, so none is made up."""
        airframe = Airframe()
        self._wind = Wind.of(imperfections, seed)
        self._pilot = SensorMode.OK
        self.vehicle = Hexacopter(airframe, self._wind, home, yaw_rad=0.0)
        self.autopilot = Autopilot(
            self.vehicle, airframe, seed=seed, boot_before_s=boot_before_s, params=params, imperfections=imperfections
        )
        self.endpoint = Endpoint(self.autopilot, gcs_present=not ground_link)
        self.ground_endpoint = Endpoint(self.autopilot, gcs_present=False) if ground_link else None
        if self.ground_endpoint is not None:
            self.endpoint.connect(self.ground_endpoint)

    @property
    def body(self) -> RigidBody:
        """The vehicle's rigid body."""
        return self.vehicle.body

    @property
    def estimator(self) -> Estimator:
        """The simulated autopilot's."""
        return self.autopilot.estimator

    @property
    def landed_state(self) -> LandedState:
        """MAV_LANDED_STATE of the simulated autopilot."""
        return self.autopilot.landed_state

    def late_s(self, now_s: float) -> float:  # noqa: ARG002
        """Return 0: this autopilot runs in the simulator's own time."""
        return 0.0

    def expose(self, wind: SensorMode, pilot: SensorMode) -> None:
        """Apply the faults: a stronger wind, or a pilot who takes the vehicle, turns it by the stick, or leaves it again."""
        self._wind.strong = wind is SensorMode.STRONG
        if pilot is self._pilot:
            return
        before, self._pilot = self._pilot, pilot
        if pilot in TAKEN:
            self.autopilot.set_mode(TAKEN[pilot])
        elif before in TAKEN:
            self.autopilot.set_mode(Mode.GUIDED)
        if SensorMode.STICK in {before, pilot}:
            self.autopilot.yaw_stick(STICK_RAD_S if pilot is SensorMode.STICK else 0.0)

    def tick(self, now_s: float, dt_s: float) -> bool:
        """Move the body, then let the autopilot decide and send."""
        self.vehicle.advance(dt_s)
        self.autopilot.step(now_s, dt_s)
        self.endpoint.step()
        if self.ground_endpoint is not None:
            self.ground_endpoint.step()
        return True
