"""Frame conversions: right on known cases, and their own inverses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_simulator import frames
from uav_simulator.sensors.mounts import LIDAR, ZED_LEFT, rotation_matrix
from uav_simulator.vehicle import quaternion

numbers = st.floats(-100.0, 100.0)
vectors = st.tuples(numbers, numbers, numbers)
quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1).map(lambda q: tuple(v / math.hypot(*q) for v in q))
)
NED_FROM_ENU = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
FLU_FROM_FRD = np.diag([1, -1, -1])


def test_axes_of_ned_and_enu():
    assert frames.ned_from_enu((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert frames.yaw_ned_from_enu(0.0) == pytest.approx(math.pi / 2), "east"
    assert frames.yaw_ned_from_enu(math.pi / 2) == pytest.approx(0.0), "north"


@given(vectors)
def test_vectors_go_there_and_back(v):
    assert frames.enu_from_ned(frames.ned_from_enu(v)) == v
    assert frames.frd_from_flu(frames.frd_from_flu(v)) == v


@given(st.floats(-3.1, 3.1))
def test_yaws_go_there_and_back(yaw):
    assert frames.yaw_enu_from_ned(frames.yaw_ned_from_enu(yaw)) == pytest.approx(yaw, abs=1e-9)


@given(quaternions)
def test_attitudes_agree_with_matrices(q):
    expected = NED_FROM_ENU @ rotation_matrix(q) @ FLU_FROM_FRD
    assert rotation_matrix(frames.quat_ned_frd_from_enu_flu(q)) == pytest.approx(expected, abs=1e-9)


@given(quaternions, vectors)
def test_rotating_is_the_matrix(q, v):
    assert quaternion.rotate(q, v) == pytest.approx(tuple(rotation_matrix(q) @ np.array(v)), abs=1e-6)


@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-3.0, 3.0))
def test_a_tilted_attitude_points_its_rotors_up_as_wanted(x, y, yaw):
    up = (x, y, math.sqrt(1.0 - x * x - y * y))
    assert quaternion.rotate(quaternion.tilted(up, yaw), (0.0, 0.0, 1.0)) == pytest.approx(up, abs=1e-9)


def test_mounts_look_where_they_should():
    forward, left, up = np.eye(3)
    assert ZED_LEFT.matrix[:, 2] == pytest.approx(forward)
    assert ZED_LEFT.matrix[:, 0] == pytest.approx(-left)
    assert LIDAR.matrix[:, 2] == pytest.approx(forward), "the spin axis; the scan plane is across the direction of flight"
    assert LIDAR.matrix[:, 1] == pytest.approx(up)


def test_geodetic_degrees():
    lat, lon, alt = frames.geodetic_from_enu((111.32, 111.32, 5.0), (0.0, 0.0, 10.0))
    assert (lat, lon, alt) == pytest.approx((0.001, 0.001, 15.0), abs=2e-6)
