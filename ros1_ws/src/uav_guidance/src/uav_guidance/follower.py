"""Follow one reference, and a heading beside it: carrots out of the vehicle's place and the time, held back by obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_guidance.carrot import HeadingCarrot
from uav_guidance.frames import wrap
from uav_guidance.obstacles import ObstacleWatch, Way
from uav_guidance.references import Heading, Land, Reference, Takeoff
from uav_guidance.settings import GuidanceSettings
from uav_guidance.stillness import StillWatch
from uav_guidance.vectors import Line, Vec3
from uav_guidance.vehicle import Mode, VehicleSnapshot

SETPOINT_PERIOD_S = 0.1
# The clock has steps of its own (20 ms in simulation): a tenth of a second may look a little shorter.
PERIOD_TOLERANCE_S = 0.005
LONGEST_STEP_S = 0.2  # after a pause of the clock or the link the carrot must not jump


@dataclass(frozen=True)
class Setpoint:
    """Where the vehicle should be now, and its heading: metres, radians; the guidance sends it in `odom`."""

    position_enu_m: Vec3
    yaw_rad: float


@dataclass(frozen=True)
class Course:
    """The reference and how far the vehicle is from it; the fields are those of uav_msgs/GuidanceState."""

    reference: str
    target_enu_m: Vec3
    target_yaw_rad: float
    remaining_enu_m: Vec3
    drift_m: float
    heading_error_rad: float
    heading_locked: bool
    still_s: float
    obstacle_stop: bool
    obstacle_m: float
    unwatched: bool


class Follower:
    """Keeps the reference and computes the setpoint of now. The vehicle's snapshot is passed to each call."""

    def __init__(self, settings: GuidanceSettings) -> None:
        self.reference: Reference | None = None
        self.heading = Heading(HeadingCarrot(0.0))
        self.obstacles = ObstacleWatch(settings)
        self.streaming = False
        self._still = StillWatch(reached_m=settings.reached_m, reached_rad=settings.reached_rad)
        self._still_s = 0.0
        self._blocked = False
        self._seen_armed = self._was_off_ground = False
        self._last_step_s: float | None = None
        self._last_setpoint_s = -math.inf

    def tune(self, settings: GuidanceSettings) -> None:
        """Set other settings; the reference under way keeps those that it began with."""
        self.obstacles.settings = settings
        self._still.tune(reached_m=settings.reached_m, reached_rad=settings.reached_rad)

    def take(self, reference: Reference | None, vehicle: VehicleSnapshot, now_s: float) -> None:
        """Follow another reference from now on, or none."""
        self.reference = reference
        self.streaming = self._blocked = self._seen_armed = False
        self._last_setpoint_s = -math.inf
        self.obstacles.forget_hold()
        self._still.restart(now_s)
        if reference is not None:
            reference.accept(vehicle, self.heading)

    def begin_again(self, vehicle: VehicleSnapshot, now_s: float) -> None:
        """Follow the same reference from where the vehicle is now: its place in `map` has jumped, the vehicle has not."""
        self.heading.carrot.yaw_rad = vehicle.yaw_rad
        self.streaming = False
        self._last_setpoint_s = -math.inf
        self._still.restart(now_s)
        if self.reference is not None:
            self.reference.accept(vehicle, self.heading)

    def lock_heading(self, yaw_rad: float, rate_rad_s: float, now_s: float) -> None:
        """Turn to a heading and keep it, whatever is followed."""
        self.heading.locked = True
        self.heading.carrot.turn(yaw_rad, rate_rad_s)
        self._still.restart(now_s)

    def over(self, vehicle: VehicleSnapshot) -> bool:
        """Return whether the reference ended on the ground with the motors off; a landing keeps its name after that."""
        if isinstance(self.reference, Land | None) or vehicle.armed or not vehicle.on_ground:
            return False
        # A heartbeat shows up to a second late that the vehicle is armed: a take-off has ended only if it was so before.
        return self._seen_armed or not isinstance(self.reference, Takeoff)

    def step(self, vehicle: VehicleSnapshot, now_s: float, *, commanded: bool) -> Setpoint | None:
        """Move the carrots on to this time and return a setpoint if one is due; ``commanded``: the companion has the authority."""
        dt_s = 0.0 if self._last_step_s is None else min(max(now_s - self._last_step_s, 0.0), LONGEST_STEP_S)
        self._last_step_s = now_s
        self._seen_armed |= vehicle.armed
        if vehicle.off_ground and not self._was_off_ground:
            self._still.restart(now_s)  # spooling the motors up is no lack of progress
        self._was_off_ground = vehicle.off_ground
        if vehicle.on_ground and not vehicle.armed:
            self.obstacles.forget_sensors()
        setpoint = self._follow(vehicle, now_s, dt_s) if commanded else None
        self._measure_stillness(vehicle, now_s)
        return setpoint

    def course(self, vehicle: VehicleSnapshot, now_s: float) -> Course:
        """Return what is followed and how far the vehicle is from it."""
        place = vehicle.position_enu_m or Vec3()
        reference, error_rad = self.reference, self._heading_error(vehicle)
        line = Line(place, place) if reference is None else reference.line
        return Course(
            reference=Reference.name if reference is None else reference.name,
            target_enu_m=line.target,
            target_yaw_rad=wrap(vehicle.yaw_rad + error_rad),
            remaining_enu_m=self._remaining(vehicle),
            drift_m=line.distance(place),
            heading_error_rad=error_rad,
            heading_locked=self.heading.locked,
            still_s=self._still_s,
            obstacle_stop=self._blocked,
            obstacle_m=self.obstacles.nearest_m(now_s),
            unwatched=self.obstacles.unwatched(now_s),
        )

    def _follow(self, vehicle: VehicleSnapshot, now_s: float, dt_s: float) -> Setpoint | None:
        reference = self.reference
        if isinstance(reference, Takeoff) and not self.streaming:
            reference.keep_to_home(vehicle.home_enu_m)
        # Setpoints are for GUIDED only, and for a vehicle whose take-off they can't cancel.
        if reference is None or vehicle.mode != Mode.GUIDED or not vehicle.located or vehicle.landed not in reference.STREAMS_IN:
            return None
        if not self.streaming:
            reference.start(vehicle, self.heading)
            self.streaming = True
        self._blocked = reference.travelling and self.obstacles.blocked(self._way(vehicle), now_s)
        position = reference.setpoint(vehicle, blocked=self._blocked, dt_s=dt_s)
        yaw_rad = self.heading.carrot.step(vehicle.yaw_rad, dt_s)
        if now_s - self._last_setpoint_s < SETPOINT_PERIOD_S - PERIOD_TOLERANCE_S:
            return None
        self._last_setpoint_s = now_s
        return Setpoint(position, yaw_rad)

    def _way(self, vehicle: VehicleSnapshot) -> Way:
        remaining = self._remaining(vehicle)
        ahead_m_s = vehicle.velocity_enu_m_s.dot(remaining) / remaining.norm if remaining.norm > 0.0 else 0.0
        return Way(vehicle.position_enu_m or Vec3(), remaining, max(ahead_m_s, 0.0))

    def _remaining(self, vehicle: VehicleSnapshot) -> Vec3:
        return Vec3() if self.reference is None else self.reference.remaining(vehicle)

    def _heading_error(self, vehicle: VehicleSnapshot) -> float:
        """Return the way to the heading's target, counter-clockwise positive; zero while the autopilot minds the heading itself."""
        if isinstance(self.reference, Land | None) or (isinstance(self.reference, Takeoff) and not self.streaming):
            return 0.0
        return wrap(self.heading.carrot.target_rad - vehicle.yaw_rad)

    def _measure_stillness(self, vehicle: VehicleSnapshot, now_s: float) -> None:
        distance_m = self._remaining(vehicle).norm
        self._still_s = self._still.step(distance_m=distance_m, heading_error_rad=self._heading_error(vehicle), now_s=now_s)
