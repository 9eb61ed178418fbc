"""Build the autopilot's messages from its state; ENU becomes NED here."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_simulator.autopilot.core import Autopilot
from uav_simulator.autopilot.estimator import ALIGNED_AFTER_S
from uav_simulator.autopilot.satellites import FIX_3D
from uav_simulator.frames import (
    Vec3,
    frd_from_flu,
    geodetic_from_enu,
    ned_from_enu,
    quat_ned_frd_from_enu_flu,
    yaw_ned_from_enu,
)

ORIGIN: Vec3 = (43.5660, 1.4740, 150.0)  # degrees, degrees, metres above the sea
EPOCH_US = 1_767_225_600_000_000  # 2026-01-01: the GPS time at which the simulated clock begins
PREARM_CHECK = 0x10000000
GPS_SENSOR = 0x0020
SENSORS = GPS_SENSOR | 0x0008 | 0x0004 | 0x0002 | 0x0001 | 0x1000 | 0x2000 | 0x200000  # GPS, baro, mag, gyro, accel, xy, z, AHRS
FULL_MV, EMPTY_MV, ENDURANCE_S = 25200, 19800, 1500.0
CELLS = 6
SATELLITES = 12
RELATIVE_FLAGS = (
    mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS
)  # known without a position
LOCATED_FLAGS = (
    mavlink.EKF_POS_HORIZ_REL | mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_PRED_POS_HORIZ_REL | mavlink.EKF_PRED_POS_HORIZ_ABS
)  # with one
Message = Any  # pymavlink's messages have no types


def heartbeat(pilot: Autopilot) -> Message:
    """Return HEARTBEAT: a hexarotor of ArduPilot; armed is a flag, the mode a number."""
    flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if pilot.armed else 0
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_HEXAROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, flags, int(pilot.mode), int(pilot.system_status), 3
    )


def boot_ms(pilot: Autopilot) -> int:
    """Return the milliseconds since power-up."""
    return round(pilot.boot_s * 1000.0)


def charge(pilot: Autopilot) -> float:
    """Return the battery's charge, 0..1."""
    return max(0.0, 1.0 - pilot.flown_s / ENDURANCE_S)


def battery_mv(pilot: Autopilot) -> int:
    """Return the battery's voltage in millivolts."""
    return round(EMPTY_MV + (FULL_MV - EMPTY_MV) * charge(pilot))


def sys_status(pilot: Autopilot) -> Message:
    """Return SYS_STATUS; the PREARM_CHECK bit says whether the vehicle can be armed."""
    known = SENSORS | PREARM_CHECK
    health = known if pilot.ready else SENSORS & ~0x200000
    health &= ~(0 if pilot.estimator.satellites.fix == FIX_3D else GPS_SENSOR)
    current_ca = 4500 if not pilot.landed else 50
    return mavlink.MAVLink_sys_status_message(
        known, known, health, 150, battery_mv(pilot), current_ca, round(100.0 * charge(pilot)), 0, 0, 0, 0, 0, 0
    )


def system_time(pilot: Autopilot) -> Message:
    """Return SYSTEM_TIME; the date is made up."""
    return mavlink.MAVLink_system_time_message(EPOCH_US + round(pilot.now_s * 1e6), boot_ms(pilot))


def attitude(pilot: Autopilot) -> Message:
    """Return ATTITUDE: roll is the same in both frames, pitch and yaw change their sense."""
    roll, pitch, yaw = pilot.estimate.euler
    p, q, r = frd_from_flu(pilot.estimate.rates)
    return mavlink.MAVLink_attitude_message(boot_ms(pilot), roll, -pitch, yaw_ned_from_enu(yaw), p, q, r)


def attitude_quaternion(pilot: Autopilot) -> Message:
    """Return the message ATTITUDE_QUATERNION: the estimated attitude and rates, NED to FRD."""
    w, x, y, z = quat_ned_frd_from_enu_flu(pilot.estimate.attitude)
    p, q, r = frd_from_flu(pilot.estimate.rates)
    return mavlink.MAVLink_attitude_quaternion_message(boot_ms(pilot), w, x, y, z, p, q, r)


def local_position(pilot: Autopilot) -> Message | None:
    """Return LOCAL_POSITION_NED, None as long as there is no position."""
    if not pilot.located:
        return None
    return mavlink.MAVLink_local_position_ned_message(
        boot_ms(pilot), *ned_from_enu(pilot.estimate.position), *ned_from_enu(pilot.estimate.velocity)
    )


def global_position(pilot: Autopilot) -> Message:
    """Return the message GLOBAL_POSITION_INT: 1e-7 degrees, mm, cm/s, 0.01 degrees."""
    lat, lon, alt = geodetic_from_enu(pilot.estimate.position, ORIGIN)
    vx, vy, vz = ned_from_enu(pilot.estimate.velocity)
    above_home = pilot.estimate.position[2] - (pilot.home[2] if pilot.home else 0.0)
    heading = round(math.degrees(yaw_ned_from_enu(pilot.estimate.yaw_rad)) * 100.0) % 36000
    cm = (round(vx * 100.0), round(vy * 100.0), round(vz * 100.0))
    return mavlink.MAVLink_global_position_int_message(
        boot_ms(pilot), round(lat * 1e7), round(lon * 1e7), round(alt * 1000.0), round(above_home * 1000.0), *cm, heading
    )


def extended_sys_state(pilot: Autopilot) -> Message:
    """Return EXTENDED_SYS_STATE with the landed state."""
    return mavlink.MAVLink_extended_sys_state_message(0, int(pilot.landed_state))


def position_target(pilot: Autopilot) -> Message:
    """Return POSITION_TARGET_LOCAL_NED: the target place or velocity."""
    goal = pilot.goal
    mask = (
        mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    )
    mask |= mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    mask |= 0x0007 if goal.xy is None else 0
    place = ned_from_enu((*(goal.xy or (0.0, 0.0)), goal.z or 0.0))
    yaw = yaw_ned_from_enu(pilot.yaw_target_rad)
    return mavlink.MAVLink_position_target_local_ned_message(
        boot_ms(pilot), mavlink.MAV_FRAME_LOCAL_NED, mask, *place, *ned_from_enu(goal.velocity), 0.0, 0.0, 0.0, yaw, 0.0
    )


def battery_status(pilot: Autopilot) -> Message:
    """Return BATTERY_STATUS of the one battery."""
    cells = [round(battery_mv(pilot) / CELLS)] * CELLS + [65535] * (10 - CELLS)
    return mavlink.MAVLink_battery_status_message(0, 0, 1, 32767, cells, 4500, -1, -1, round(100.0 * charge(pilot)))


def home_position(pilot: Autopilot) -> Message | None:
    """Return HOME_POSITION, None as long as there is none."""
    if pilot.home is None:
        return None
    lat, lon, alt = geodetic_from_enu(pilot.home, ORIGIN)
    local = ned_from_enu(pilot.home)
    level = [1.0, 0.0, 0.0, 0.0]
    return mavlink.MAVLink_home_position_message(round(lat * 1e7), round(lon * 1e7), round(alt * 1000), *local, level, 0.0, 0.0, 0.0, 0)


def gps_global_origin(pilot: Autopilot) -> Message | None:
    """Return GPS_GLOBAL_ORIGIN, None as long as there is none."""
    if not pilot.has_origin:
        return None
    lat, lon, alt = ORIGIN
    return mavlink.MAVLink_gps_global_origin_message(round(lat * 1e7), round(lon * 1e7), round(alt * 1000))


def gps_raw(pilot: Autopilot) -> Message | None:
    """Return GPS_RAW_INT; None where the receiver is silent [18]."""
    fix = pilot.estimator.satellites.fix
    if fix is None:
        return None
    lat, lon, alt = geodetic_from_enu(pilot.estimate.position, ORIGIN) if fix == FIX_3D else (0.0, 0.0, 0.0)
    seen = SATELLITES if fix == FIX_3D else 0
    place = (round(lat * 1e7), round(lon * 1e7), round(alt * 1000))
    return mavlink.MAVLink_gps_raw_int_message(round(pilot.boot_s * 1e6), fix, *place, 121, 200, 65535, 65535, seen)


def ekf_status(pilot: Autopilot) -> Message:
    """Return the message EKF_STATUS_REPORT: the estimator's flags [18]."""
    aligned = pilot.boot_s >= ALIGNED_AFTER_S
    flags = (RELATIVE_FLAGS if aligned else 0) | (LOCATED_FLAGS if pilot.located else mavlink.EKF_CONST_POS_MODE)
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.05, 0.05, 0.05, 0.05, 0.0)


BUILDERS: dict[int, Callable[[Autopilot], Message | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: position_target,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
}
