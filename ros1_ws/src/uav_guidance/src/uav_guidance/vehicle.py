"""What is known of the vehicle: an immutable snapshot, and how each MAVLink message changes it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_guidance.frames import (
    Quaternion,
    enu_from_ned,
    local_enu_from_global,
    quaternion_enu_flu,
    rates_flu_from_frd,
    turned_about_vertical,
    wrap,
    yaw_enu_from_ned,
)
from uav_guidance.localization import Correction
from uav_guidance.vectors import ZERO, Vec3

ARMED_FLAG = 128  # MAV_MODE_FLAG_SAFETY_ARMED
PREARM_CHECK = 0x10000000  # MAV_SYS_STATUS_PREARM_CHECK
MOST_ACCEL_M_S2 = 5.0  # of a multicopter in guided flight
LATE_S = 1.0  # a place or an attitude that was told longer ago than something else is not known any more
REBOOT_MS = 1000  # the autopilot's clock may step back by less (messages out of order)

MULTICOPTERS = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
    }
)

GlobalPlace = tuple[int, int, int]


class Mode(IntEnum):
    """ArduCopter's flight modes (``custom_mode`` of HEARTBEAT)."""

    STABILIZE = 0
    ACRO = 1
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    CIRCLE = 7
    LAND = 9
    DRIFT = 11
    SPORT = 13
    FLIP = 14
    AUTOTUNE = 15
    POSHOLD = 16
    BRAKE = 17
    THROW = 18
    AVOID_ADSB = 19
    GUIDED_NOGPS = 20
    SMART_RTL = 21
    FLOWHOLD = 22
    FOLLOW = 23
    ZIGZAG = 24
    SYSTEMID = 25
    AUTOROTATE = 26
    AUTO_RTL = 27
    TURTLE = 28


class Landed(IntEnum):
    """MAV_LANDED_STATE, as EXTENDED_SYS_STATE has it."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


def mode_name(mode: int | None) -> str:
    """Return a mode's name, or its number if it has none here; empty before the first heartbeat."""
    if mode is None:
        return ""
    return Mode(mode).name if mode in Mode._value2member_map_ else str(mode)


def _foreign(autopilot: int, vehicle_type: int) -> str:
    """Return what an autopilot is that is no ArduPilot on a multicopter; empty if it is one."""
    if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA and vehicle_type in MULTICOPTERS:
        return ""
    return f"{_name('MAV_AUTOPILOT', autopilot)} on a {_name('MAV_TYPE', vehicle_type)}"


def _name(enum: str, value: int) -> str:
    """Return MAVLink's name of a value without its prefix."""
    entry = mavlink.enums[enum].get(value)
    return f"{enum} {value}" if entry is None else entry.name.removeprefix(f"{enum}_")


@dataclass(frozen=True)
class VehicleSnapshot:
    """A snapshot of the vehicle, metres, radians, body FLU; places in `odom` (ENU, origin at the EKF origin), or by `in_map` in `map`."""

    heartbeat_s: float | None = None
    foreign: str = ""
    """What the autopilot is, by HEARTBEAT, where it is no ArduPilot on a multicopter: its modes and commands have other meanings."""
    critical: bool = False
    """Whether HEARTBEAT's system_status is MAV_STATE_CRITICAL: a failsafe of the autopilot is active."""
    mode: int | None = None
    armed: bool = False
    ready: bool = False
    landed: Landed = Landed.UNDEFINED
    boot_ms: int = 0
    boots: int = 1
    """How often the autopilot was seen to start, the first time included."""
    place_s: float = -math.inf
    attitude_s: float = -math.inf
    """When place and attitude were received last, seconds of the mission clock, as ``heartbeat_s``."""
    gps_s: float = -math.inf
    fix_s: float | None = None
    """When the GPS was reported last, and when with a fix in three dimensions; None: never with one."""
    estimator_flags: int | None = None
    """EKF_STATUS_FLAGS of the autopilot's estimator; None: not received."""
    position_enu_m: Vec3 | None = None
    velocity_enu_m_s: Vec3 = ZERO
    quat_xyzw: Quaternion | None = None
    yaw_rad: float = 0.0
    rates_flu_rad_s: Vec3 = ZERO
    attitude_boot_ms: int = 0
    origin: GlobalPlace | None = None
    home: GlobalPlace | None = None
    home_local_enu_m: Vec3 = ZERO
    home_enu_m: Vec3 | None = None

    @property
    def located(self) -> bool:
        """Whether position and attitude are known: an estimator that has lost its position sends none, though heartbeats go on."""
        newest_s = max(self.heartbeat_s or 0.0, self.place_s, self.attitude_s)
        return self.position_enu_m is not None and self.quat_xyzw is not None and newest_s - min(self.place_s, self.attitude_s) < LATE_S

    @property
    def on_ground(self) -> bool:
        """Whether the autopilot reports that it stands."""
        return self.landed is Landed.ON_GROUND

    @property
    def off_ground(self) -> bool:
        """Whether it has lifted off: the landed state is known and is not "on ground"."""
        return self.landed in {Landed.IN_AIR, Landed.TAKING_OFF, Landed.LANDING}


def in_map(vehicle: VehicleSnapshot, correction: Correction, home_map_m: Vec3 | None) -> VehicleSnapshot:
    """Return a snapshot with its place, velocity, attitude and home in `map` in place of `odom`."""
    place, quaternion = vehicle.position_enu_m, vehicle.quat_xyzw
    return replace(
        vehicle,
        position_enu_m=None if place is None else correction.to_map(place),
        velocity_enu_m_s=vehicle.velocity_enu_m_s.turned(correction.yaw_rad),
        quat_xyzw=None if quaternion is None else turned_about_vertical(quaternion, correction.yaw_rad),
        yaw_rad=wrap(vehicle.yaw_rad + correction.yaw_rad),
        home_enu_m=home_map_m,
    )


def leapt(before: VehicleSnapshot, after: VehicleSnapshot, most_m: float) -> bool:
    """Return whether the place differs by more than ``most_m`` from what the motion explains: the autopilot's estimator was reset."""
    if before.position_enu_m is None or after.position_enu_m is None or after.boots != before.boots:
        return False
    gap_s = max(after.boot_ms - before.boot_ms, 0) * 1e-3
    expected = before.position_enu_m + before.velocity_enu_m_s * gap_s
    return (after.position_enu_m - expected).norm > most_m + 0.5 * MOST_ACCEL_M_S2 * gap_s**2


def _heartbeat(vehicle: VehicleSnapshot, message: Any, now_s: float) -> VehicleSnapshot:
    return replace(
        vehicle,
        heartbeat_s=now_s,
        foreign=_foreign(message.autopilot, message.type),
        critical=message.system_status == mavlink.MAV_STATE_CRITICAL,
        mode=int(message.custom_mode),
        armed=bool(message.base_mode & ARMED_FLAG),
    )


def _sys_status(vehicle: VehicleSnapshot, message: Any, _now_s: float) -> VehicleSnapshot:
    return replace(vehicle, ready=bool(message.onboard_control_sensors_health & PREARM_CHECK))


def _extended_sys_state(vehicle: VehicleSnapshot, message: Any, _now_s: float) -> VehicleSnapshot:
    known = message.landed_state in Landed._value2member_map_
    return replace(vehicle, landed=Landed(message.landed_state) if known else Landed.UNDEFINED)


def _gps(vehicle: VehicleSnapshot, message: Any, now_s: float) -> VehicleSnapshot:
    fixed = message.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX
    return replace(vehicle, gps_s=now_s, fix_s=now_s if fixed else vehicle.fix_s)


def _estimator(vehicle: VehicleSnapshot, message: Any, _now_s: float) -> VehicleSnapshot:
    return replace(vehicle, estimator_flags=int(message.flags))


def _of_this_boot(vehicle: VehicleSnapshot, message: Any) -> VehicleSnapshot:
    """Forget what was received before a restart; the attitude shows it at once, a position comes half a minute later."""
    if message.time_boot_ms + REBOOT_MS >= max(vehicle.boot_ms, vehicle.attitude_boot_ms):
        return vehicle
    fresh = VehicleSnapshot(heartbeat_s=vehicle.heartbeat_s, foreign=vehicle.foreign, critical=vehicle.critical)
    return replace(fresh, mode=vehicle.mode, armed=vehicle.armed, boots=vehicle.boots + 1)


def _local_position(vehicle: VehicleSnapshot, message: Any, now_s: float) -> VehicleSnapshot:
    return replace(
        _of_this_boot(vehicle, message),
        place_s=now_s,
        boot_ms=int(message.time_boot_ms),
        position_enu_m=enu_from_ned(Vec3(message.x, message.y, message.z)),
        velocity_enu_m_s=enu_from_ned(Vec3(message.vx, message.vy, message.vz)),
    )


def _attitude(vehicle: VehicleSnapshot, message: Any, now_s: float) -> VehicleSnapshot:
    return replace(
        _of_this_boot(vehicle, message),
        attitude_s=now_s,
        quat_xyzw=quaternion_enu_flu(message.roll, message.pitch, message.yaw),
        yaw_rad=yaw_enu_from_ned(message.yaw),
        rates_flu_rad_s=rates_flu_from_frd(Vec3(message.rollspeed, message.pitchspeed, message.yawspeed)),
        attitude_boot_ms=int(message.time_boot_ms),
    )


def _home_position(vehicle: VehicleSnapshot, message: Any, _now_s: float) -> VehicleSnapshot:
    local = enu_from_ned(Vec3(message.x, message.y, message.z))
    return _with_home(replace(vehicle, home=(message.latitude, message.longitude, message.altitude), home_local_enu_m=local))


def _global_origin(vehicle: VehicleSnapshot, message: Any, _now_s: float) -> VehicleSnapshot:
    return _with_home(replace(vehicle, origin=(message.latitude, message.longitude, message.altitude)))


def _with_home(vehicle: VehicleSnapshot) -> VehicleSnapshot:
    """Set home in `odom`: from the two global positions, because ArduPilot leaves HOME_POSITION's local fields at zero."""
    if vehicle.home is None:
        return vehicle
    local = vehicle.home_local_enu_m if vehicle.origin is None else local_enu_from_global(vehicle.home, vehicle.origin)
    return replace(vehicle, home_enu_m=local)


_CHANGES: dict[str, Callable[[VehicleSnapshot, Any, float], VehicleSnapshot]] = {
    "HEARTBEAT": _heartbeat,
    "SYS_STATUS": _sys_status,
    "EXTENDED_SYS_STATE": _extended_sys_state,
    "LOCAL_POSITION_NED": _local_position,
    "ATTITUDE": _attitude,
    "GPS_RAW_INT": _gps,
    "EKF_STATUS_REPORT": _estimator,
    "HOME_POSITION": _home_position,
    "GPS_GLOBAL_ORIGIN": _global_origin,
}

_NUMBERS = {
    "LOCAL_POSITION_NED": ("x", "y", "z", "vx", "vy", "vz"),
    "ATTITUDE": ("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"),
    "HOME_POSITION": ("x", "y", "z"),
}
"""The fields that are floats, and used."""


def updated(vehicle: VehicleSnapshot, message: Any, now_s: float) -> VehicleSnapshot:
    """Return the snapshot after a MAVLink message of the autopilot; the same one if the message does not concern it.

    A message with a number that is none is ignored: an estimator that has diverged must not become a setpoint.
    """
    change = _CHANGES.get(message.get_type())
    numbers = (getattr(message, name) for name in _NUMBERS.get(message.get_type(), ()))
    return vehicle if change is None or not all(map(math.isfinite, numbers)) else change(vehicle, message, now_s)
