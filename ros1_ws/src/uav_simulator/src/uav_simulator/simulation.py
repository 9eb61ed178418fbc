"""The whole simulation without ROS: a world, a vehicle with its pilot, and the sensors that see both, on a clock of its own.

One tick is 20 ms. Everything that varies is drawn from generators of the seed, each for one purpose, so the same seed and the
same commands give the same flight, images and clouds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from alula.common.faults import FaultRequest
from uav_simulator.autopilot.estimator import PERFECT
from uav_simulator.autopilot.types import LandedState
from uav_simulator.contacts import ContactMonitor
from uav_simulator.flown import Flown
from uav_simulator.imperfections import Imperfections
from uav_simulator.sensors.faults import AUTOPILOTS, SensorBoard, SensorMode
from uav_simulator.sensors.imu import Imu
from uav_simulator.sensors.lidar import Lidar
from uav_simulator.sensors.pose_track import Pose, PoseTrack
from uav_simulator.sensors.stereo import StereoPair
from uav_simulator.world.config import WorldConfig
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene

TICK_NS = 20_000_000
TICK_S = TICK_NS * 1e-9
STOPPED_ROTOR = 0  # by the fault of a motor; they are alike


@dataclass(frozen=True)
class SimulationState:
    """The truth, which no node in the air knows; times on the simulated clock."""

    t_s: float
    lift_off_s: float | None
    collisions: int
    crash: str
    min_clearance_m: float | None
    distance_m: float
    sensors: dict[str, str]
    faults: list[dict[str, str | float]]


class Simulation:
    """Steps everything; the caller decides when, and asks for the measurements it wants."""

    def __init__(
        self,
        config: WorldConfig,
        flown: Flown,
        *,
        seed: int,
        faults: Sequence[FaultRequest] = (),
        imperfections: Imperfections = PERFECT,
    ) -> None:
        self.seed = seed
        self.now_ns = 0
        self.flown = flown
        self.world = Scene(build_parts(config, seed))
        self.imperfections = imperfections
        self.stereo = StereoPair(self.world, seed, noise=imperfections.pixel_noise, exposure=imperfections.exposure)
        self.lidar = Lidar(self.world, seed, noise_m=imperfections.range_noise_m)
        self.imu = Imu(seed, gyro_bias_rad_s=imperfections.gyro_bias_rad_s, accel_bias_m_s2=imperfections.accel_bias_m_s2)
        self.sensors = SensorBoard(faults, absent=() if flown.estimator else AUTOPILOTS)
        self.track = PoseTrack()
        self._contacts = ContactMonitor(self.world, flown.body.airframe.radius_m)
        self.lift_off_s: float | None = None
        self._distance_m = 0.0
        self.track.add(self.pose)

    @property
    def now_s(self) -> float:
        """Return the simulated time in seconds."""
        return self.now_ns * 1e-9

    @property
    def pose(self) -> Pose:
        """Return the true pose of this moment."""
        return Pose(self.now_s, self.flown.body.position, self.flown.body.attitude)

    def tick(self) -> bool:
        """Advance by 20 ms: the vehicle moves, contacts and faults are looked after. False: its autopilot has not come so far yet."""
        body = self.flown.body
        before = body.position
        if not self.flown.tick((self.now_ns + TICK_NS) * 1e-9, TICK_S):
            return False
        self.now_ns += TICK_NS
        landed_state = self.flown.landed_state
        if self.lift_off_s is None and landed_state is not LandedState.ON_GROUND:
            self.lift_off_s = self.now_s
        if landed_state is not LandedState.ON_GROUND:
            self._distance_m += math.dist(before, body.position)
        self._contacts.step(body, landed_state)
        self.sensors.apply_due(self.now_s, self.lift_off_s)
        if self.flown.estimator is not None:
            self.flown.estimator.barometer.broken = self.sensors.mode("barometer") is SensorMode.DRIFTING
            satellites, gps = self.flown.estimator.satellites, self.sensors.mode("gps")
            satellites.silent, satellites.jammed = gps is SensorMode.DEAD, gps is SensorMode.JAMMED
        self.flown.expose(self.sensors.mode("wind"), self.sensors.mode("pilot"))
        body.stopped_rotor = STOPPED_ROTOR if self.sensors.mode("motor") is SensorMode.STOPPED else None
        self.track.add(self.pose)
        return True

    @property
    def state(self) -> SimulationState:
        """Return the present state for ``/sim/state``."""
        clearance = self._contacts.min_clearance_m
        return SimulationState(
            t_s=round(self.now_s, 3),
            lift_off_s=None if self.lift_off_s is None else round(self.lift_off_s, 3),
            collisions=self._contacts.collisions,
            crash=self._contacts.crash,
            min_clearance_m=round(clearance, 3) if math.isfinite(clearance) else None,
            distance_m=round(self._distance_m, 2),
            sensors=self.sensors.modes,
            faults=[{"sensor": r.sensor, "mode": r.mode.value, "t_s": round(r.t_s, 3)} for r in self.sensors.records],
        )
