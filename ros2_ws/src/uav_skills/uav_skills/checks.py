"""Checks of a skill's inputs: pure, each returns "" or the reason of the refusal with the value and the limit."""

from __future__ import annotations

import math

from uav_msgs.msg import FlightLimits

MAX_DURATION_S = 600.0


def check_between(name: str, value: float, low: float, high: float, unit: str) -> str:
    """Refuse what is not a finite number above ``low`` and at most ``high``."""
    if not math.isfinite(value):
        return f"{name} is {value}, not a finite number"
    if not low < value <= high:
        return f"{name} is {value:g} {unit}; it must be above {low:g} and at most {high:g} {unit}"
    return ""


def check_takeoff(*, height_m: float, speed_m_s: float) -> str:
    """Refuse a height outside the fence or a speed that the vehicle must not fly."""
    return check_between("height", height_m, 0.0, FlightLimits.FENCE_HEIGHT_M, "m") or check_between(
        "speed", speed_m_s, 0.0, FlightLimits.MAX_SPEED_M_S, "m/s"
    )


def check_target(*, target_enu_m: tuple[float, float, float], speed_m_s: float) -> str:
    """Refuse a target that is surely outside the fence (the guidance knows home and checks it exactly), or a speed too high."""
    x, y, z = target_enu_m
    if not all(math.isfinite(value) for value in target_enu_m):
        return f"target ({x}, {y}, {z}) has a coordinate that is not a finite number"
    radius_m = math.hypot(x, y)
    if radius_m > FlightLimits.FENCE_RADIUS_M:
        return f"target ({x:g}, {y:g}, {z:g}) is {radius_m:.1f} m from home; the fence is at {FlightLimits.FENCE_RADIUS_M:g} m"
    return check_between("target height", z, 0.0, FlightLimits.FENCE_HEIGHT_M, "m") or check_between(
        "speed", speed_m_s, 0.0, FlightLimits.MAX_SPEED_M_S, "m/s"
    )


def check_turn(*, heading_rad: float, rate_rad_s: float) -> str:
    """Refuse a heading that is no number or a rate that would smear the sensors' measurements."""
    if not math.isfinite(heading_rad):
        return f"heading is {heading_rad}, not a finite number"
    return check_between("rate", rate_rad_s, 0.0, FlightLimits.MAX_YAW_RATE_RAD_S, "rad/s")


def check_duration(*, duration_s: float) -> str:
    """Refuse a time that is no number, not positive, or longer than the batteries last."""
    return check_between("duration", duration_s, 0.0, MAX_DURATION_S, "s")


def check_stream(*, min_fps: float, min_quality: float, patience_s: float) -> str:
    """Refuse a frame rate, a similarity or a patience that no stream can be held to."""
    if not 0.0 <= min_quality < 1.0:
        return f"min_quality is {min_quality:g}; it must be at least 0 and below 1 (structural similarity)"
    if not 1.0 <= patience_s <= 60.0:
        return f"patience is {patience_s:g} s; it must be between 1 and 60 s"
    return check_between("min_fps", min_fps, 0.0, 60.0, "frames per second")
