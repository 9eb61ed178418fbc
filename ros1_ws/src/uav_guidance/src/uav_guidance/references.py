"""What the guidance follows: each reference says where the vehicle should be now, on its way to a target."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from uav_guidance.carrot import HeadingCarrot, LineCarrot, stop_point
from uav_guidance.frames import wrap
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Line, Vec3
from uav_guidance.vehicle import Landed, VehicleSnapshot

LEAST_TRAVEL_FOR_HEADING_M = 0.5


@dataclass
class Heading:
    """The heading reference, independent of the position reference: a carrot, and whether it is locked."""

    carrot: HeadingCarrot
    locked: bool = False

    def leave(self, yaw_rad: float) -> None:
        """Keep the present heading, unless another one is locked."""
        if not self.locked:
            self.carrot.hold(yaw_rad)


class Reference:
    """A reference that streams nothing: the vehicle does by itself what it was commanded to."""

    name: ClassVar[str] = "idle"
    STREAMS_IN: ClassVar[frozenset[Landed]] = frozenset()

    def __init__(self, line: Line) -> None:
        self.line = line

    def accept(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Set the line and the heading's target, when the reference is accepted."""

    def start(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Begin at the vehicle's present place; called at the first step at which setpoints may be streamed."""

    def setpoint(self, vehicle: VehicleSnapshot, *, blocked: bool, dt_s: float) -> Vec3:
        """Return where the vehicle should be after one time step, `map`, metres; called in STREAMS_IN only."""
        raise NotImplementedError

    def remaining(self, vehicle: VehicleSnapshot) -> Vec3:
        """Return the way from the vehicle to the target, metres."""
        return self.line.target - _place(vehicle)

    @property
    def travelling(self) -> bool:
        """Whether it moves the vehicle along its line now, so that an obstacle ahead matters."""
        return False


IN_AIR_STATES = frozenset({Landed.IN_AIR, Landed.TAKING_OFF, Landed.LANDING})


class Hold(Reference):
    """Brake to a stop as soon as possible and stay there."""

    name: ClassVar[str] = "hover"
    STREAMS_IN = IN_AIR_STATES

    def __init__(self, settings: GuidanceSettings) -> None:
        super().__init__(Line(Vec3(), Vec3()))
        self._accel_m_s2 = settings.max_accel_m_s2

    def accept(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Stop ahead of the present motion."""
        place = _place(vehicle)
        self.line = Line(place, stop_point(place, vehicle.velocity_enu_m_s, self._accel_m_s2) if vehicle.off_ground else place)
        heading.leave(vehicle.yaw_rad)

    def start(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Stop ahead of the motion there is now."""
        self.accept(vehicle, heading)

    def setpoint(self, vehicle: VehicleSnapshot, *, blocked: bool, dt_s: float) -> Vec3:  # noqa: ARG002
        """Stay at the stop point."""
        return self.line.target


class Turn(Hold):
    """Turn on the spot: as hover, with a moving heading."""

    name: ClassVar[str] = "heading"

    def __init__(self, settings: GuidanceSettings, *, yaw_rad: float, rate_rad_s: float) -> None:
        super().__init__(settings)
        self._yaw_rad = yaw_rad
        self._rate_rad_s = rate_rad_s

    def accept(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Stop, and turn from the present heading."""
        super().accept(vehicle, heading)
        heading.carrot.turn(self._yaw_rad, self._rate_rad_s)


class Travel(Reference):
    """Fly straight to a target; if wanted, turn the nose into the travel before moving."""

    name: ClassVar[str] = "position"
    STREAMS_IN = IN_AIR_STATES

    def __init__(self, settings: GuidanceSettings, *, target_enu_m: Vec3, speed_m_s: float, along_travel: bool) -> None:
        super().__init__(Line(target_enu_m, target_enu_m))
        self._settings = settings
        self._speed_m_s = speed_m_s
        self._along_travel = along_travel
        self._aligned = False
        self._held = False
        self._carrot = self._carrot_from(target_enu_m, 0.0)

    @property
    def travelling(self) -> bool:
        """Whether the nose points along the travel, if it has to."""
        return self._aligned

    def accept(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Draw the line: from here, or from where the vehicle can stop if it must turn first."""
        place, velocity = _place(vehicle), vehicle.velocity_enu_m_s
        heading.leave(vehicle.yaw_rad)
        self._aligned = not self._along_travel or self._turn_into_travel(vehicle, heading, place)
        if self._aligned:
            line = Line(place, self.line.target)
            self._carrot = self._carrot_from(place, velocity.dot(line.direction))
        else:
            start = stop_point(place, velocity, self._settings.max_accel_m_s2)
            self._turn_into_travel(vehicle, heading, start)
            self._carrot = self._carrot_from(start, 0.0)
        self.line = self._carrot.line

    def start(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Draw the line again from where the vehicle is now."""
        self.accept(vehicle, heading)

    def setpoint(self, vehicle: VehicleSnapshot, *, blocked: bool, dt_s: float) -> Vec3:
        """Wait at the start until the nose points along the travel, then follow the carrot; brake and hold when blocked."""
        if not self._aligned:
            self._aligned = abs(wrap(self._bearing(self.line.start) - vehicle.yaw_rad)) < self._settings.yaw_aligned_rad
            return self.line.start
        place = _place(vehicle)
        if blocked and not self._held:
            self._carrot.rest_at(self.line.along(stop_point(place, vehicle.velocity_enu_m_s, self._settings.max_accel_m_s2)))
        self._held = blocked
        return self._carrot.point if blocked else self._carrot.step(place, dt_s)

    def _turn_into_travel(self, vehicle: VehicleSnapshot, heading: Heading, start: Vec3) -> bool:
        """Turn the nose into the travel; return whether it is there already (or the travel has no direction)."""
        if (self.line.target - start).horizontal < LEAST_TRAVEL_FOR_HEADING_M:
            return True
        bearing = self._bearing(start)
        heading.carrot.turn(bearing, self._settings.yaw_rate_rad_s)
        return abs(wrap(bearing - vehicle.yaw_rad)) < self._settings.yaw_aligned_rad

    def _bearing(self, start: Vec3) -> float:
        way = self.line.target - start
        return math.atan2(way.y, way.x)

    def _carrot_from(self, start: Vec3, initial_speed_m_s: float) -> LineCarrot:
        return LineCarrot(
            Line(start, self.line.target),
            speed_m_s=self._speed_m_s,
            accel_m_s2=self._settings.max_accel_m_s2,
            lead_m=self._settings.lead_m(self._speed_m_s),
            initial_speed_m_s=initial_speed_m_s,
        )


class Takeoff(Reference):
    """The autopilot's own climb; no setpoint before it says "in air", for that would cancel the take-off without a word."""

    name: ClassVar[str] = "takeoff"
    STREAMS_IN = frozenset({Landed.IN_AIR})

    def __init__(self, settings: GuidanceSettings, *, height_m: float, speed_m_s: float) -> None:
        super().__init__(Line(Vec3(), Vec3()))
        self._height_m = height_m
        self._rest = Travel(settings, target_enu_m=Vec3(), speed_m_s=speed_m_s, along_travel=False)
        self._settings = settings
        self._speed_m_s = speed_m_s

    def accept(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Draw the line straight up from here; home is reset to this place when the vehicle is armed."""
        place = _place(vehicle)
        self.line = Line(place, Vec3(place.x, place.y, place.z + self._height_m))
        heading.leave(vehicle.yaw_rad)

    def keep_to_home(self, home_enu_m: Vec3 | None) -> None:
        """Correct the target's height, which counts from home, when home was reset."""
        if home_enu_m is not None:
            target = self.line.target
            self.line = Line(self.line.start, Vec3(target.x, target.y, home_enu_m.z + self._height_m))

    def start(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Fly what remains to the target, and stay there."""
        self._rest = Travel(self._settings, target_enu_m=self.line.target, speed_m_s=self._speed_m_s, along_travel=False)
        self._rest.accept(vehicle, heading)

    def setpoint(self, vehicle: VehicleSnapshot, *, blocked: bool, dt_s: float) -> Vec3:  # noqa: ARG002
        """Go on to the target."""
        return self._rest.setpoint(vehicle, blocked=False, dt_s=dt_s)


class Land(Reference):
    """Landing in place, which the autopilot does in its own mode."""

    name: ClassVar[str] = "land"

    def __init__(self) -> None:
        super().__init__(Line(Vec3(), Vec3()))

    def accept(self, vehicle: VehicleSnapshot, heading: Heading) -> None:
        """Draw the line straight down to home's height."""
        place = _place(vehicle)
        ground = min(place.z, vehicle.home_enu_m.z) if vehicle.home_enu_m is not None else place.z
        self.line = Line(place, Vec3(place.x, place.y, ground))
        heading.leave(vehicle.yaw_rad)

    def remaining(self, vehicle: VehicleSnapshot) -> Vec3:
        """Return the way down: none once the autopilot says that it stands."""
        return Vec3() if vehicle.on_ground else super().remaining(vehicle)


def _place(vehicle: VehicleSnapshot) -> Vec3:
    return vehicle.position_enu_m if vehicle.position_enu_m is not None else Vec3()
