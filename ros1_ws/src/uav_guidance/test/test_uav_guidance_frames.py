"""Frame conversions are their own inverses; type masks are those that the autopilot was seen to follow."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from uav_guidance import frames
from uav_guidance.carrot import braking_distance, stop_point
from uav_guidance.encoding import setpoint_message
from uav_guidance.follower import Setpoint
from uav_guidance.vectors import Line, Vec3

numbers = st.floats(-1e4, 1e4)
vectors = st.builds(Vec3, numbers, numbers, numbers)
angles = st.floats(-20.0, 20.0)
near = st.floats(-100.0, 100.0)


@given(vectors)
def test_enu_and_ned_round_trip(v):
    assert frames.ned_from_enu(frames.enu_from_ned(v)) == v
    assert frames.enu_from_ned(Vec3(1.0, 2.0, 3.0)) == Vec3(2.0, 1.0, -3.0)


@given(angles)
def test_yaw_round_trip(yaw):
    there = frames.yaw_ned_from_enu(yaw)
    assert frames.wrap(frames.yaw_enu_from_ned(there) - yaw) == pytest.approx(0.0, abs=1e-9)
    assert -math.pi <= there <= math.pi


@pytest.mark.parametrize(("yaw_ned", "yaw_enu"), [(0.0, math.pi / 2), (math.pi / 2, 0.0), (-math.pi / 2, math.pi), (math.pi, -math.pi / 2)])
def test_north_and_east(yaw_ned, yaw_enu):
    assert frames.wrap(frames.yaw_enu_from_ned(yaw_ned) - yaw_enu) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), angles)
def test_attitude_maps_the_body_axes_as_the_autopilots_does(roll, pitch, yaw):
    ned_frd = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    swap = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    expected = swap @ ned_frd @ np.diag([1.0, -1.0, -1.0])
    ours = Rotation.from_quat(frames.quaternion_enu_flu(roll, pitch, yaw)).as_matrix()
    assert np.allclose(ours, expected, atol=1e-9)


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), angles, st.builds(Vec3, *[st.floats(-3, 3)] * 3), st.floats(-0.05, 0.05))
def test_attitude_turned_on_by_body_rates(roll, pitch, yaw, rates, duration):
    before = frames.quaternion_enu_flu(roll, pitch, yaw)
    turn = Rotation.from_rotvec(np.array([rates.x, rates.y, rates.z]) * duration)
    after = Rotation.from_quat(frames.turned(before, rates, duration))
    assert (Rotation.from_quat(before) * turn * after.inv()).magnitude() == pytest.approx(0.0, abs=1e-7)


def test_type_mask_and_fields_of_a_setpoint():
    message = setpoint_message(Setpoint(Vec3(1.0, 2.0, 3.0), math.radians(90.0)))
    assert message.type_mask == 0x09F8
    assert message.coordinate_frame == 1  # MAV_FRAME_LOCAL_NED
    assert (message.x, message.y, message.z) == (2.0, 1.0, -3.0)
    assert message.yaw == pytest.approx(0.0)


def test_local_position_of_a_global_place():
    origin = (473977418, 85455939, 488000)
    assert frames.local_enu_from_global(origin, origin) == Vec3()
    # one minute of latitude is a nautical mile, of longitude that times the cosine of the latitude
    north = frames.local_enu_from_global((origin[0] + 166667, origin[1], 490500), origin)
    assert north.y == pytest.approx(1855.3, abs=1.0)
    assert north.z == pytest.approx(2.5)
    east = frames.local_enu_from_global((origin[0], origin[1] + 166667, 488000), origin)
    assert east.x == pytest.approx(1855.3 * math.cos(math.radians(47.3977418)), abs=1.0)


def test_local_position_across_the_date_line():
    assert frames.local_enu_from_global((0, -1_799_999_995, 0), (0, 1_799_999_995, 0)).x == pytest.approx(10 * 0.0111318, rel=1e-4)


@given(st.builds(Vec3, near, near, near), st.builds(Vec3, near, near, near), st.builds(Vec3, near, near, near))
def test_no_point_of_a_line_is_nearer_than_its_distance(start, target, point):
    line = Line(start, target)
    distance = line.distance(point)
    for part in (0.0, 0.25, 0.5, 1.0):
        assert distance <= (point - line.at(part * line.length)).norm + 1e-6


def test_stop_point_lies_ahead_by_the_braking_distance():
    assert braking_distance(3.0, 1.5) == 3.0
    assert stop_point(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 3.0, 0.0), 1.5) == Vec3(1.0, 3.0, 0.0)
