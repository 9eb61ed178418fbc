"""A wind that is told of by how far the vehicle leans, and what is none: setting off, braking, turning, standing."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_guidance.frames import quaternion_enu_flu
from uav_guidance.vehicle import Landed, VehicleSnapshot
from uav_guidance.wind import MEAN_S, WindWatch


def leaning(roll_deg: float, pitch_deg: float, yaw_rad: float = 0.0, landed: Landed = Landed.IN_AIR) -> VehicleSnapshot:
    quaternion = quaternion_enu_flu(math.radians(roll_deg), math.radians(pitch_deg), yaw_rad)
    return VehicleSnapshot(quat_xyzw=quaternion, landed=landed)


def told(*phases: tuple[float, VehicleSnapshot]) -> list[tuple[float, str]]:
    """Let it watch through phases of so many seconds; return when it told what."""
    watch, now_s, found = WindWatch(), 0.0, []
    for duration_s, vehicle in phases:
        for _ in range(round(duration_s / 0.05)):
            now_s += 0.05
            words = watch.step(vehicle, now_s)
            found += [(now_s, words)] if words else []
    return found


def test_a_lean_that_goes_on_is_a_strong_wind_told_once_until_it_is_calm():
    strong, calm = leaning(18.0, -18.0), leaning(0.0, 5.0)  # 25 degrees in all
    ((first_s, words),) = told((30.0, strong))
    assert first_s == pytest.approx(MEAN_S * 1.6, abs=0.8)
    assert words == "the wind is strong: the vehicle leans by 20 degrees to hold its way"
    assert len(told((20.0, strong), (1.0, calm), (10.0, strong), (20.0, calm), (20.0, strong))) == 2


def test_setting_off_and_braking_and_standing_are_no_wind():
    assert told(*[(1.5, leaning(0.0, sign * 25.0)) for sign in (-1, 0, 1, 0) * 5]) == []
    assert told((30.0, leaning(0.0, 25.0, landed=Landed.ON_GROUND))) == []
    assert told((1.0, VehicleSnapshot(landed=Landed.IN_AIR))) == []


@given(st.floats(0.0, 40.0), st.floats(-math.pi, math.pi))
def test_it_is_told_exactly_beyond_20_degrees_wherever_the_nose_points(lean_deg, yaw_rad):
    found = told((40.0, leaning(lean_deg, 0.0, yaw_rad)))
    if abs(lean_deg - 20.0) > 0.1:
        assert bool(found) == (lean_deg > 20.0)
