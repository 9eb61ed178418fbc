"""Kinematics of the carrots: limits are never exceeded, the end is reached, a vehicle that does not follow is waited for."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_guidance.carrot import HeadingCarrot, LineCarrot
from uav_guidance.frames import wrap
from uav_guidance.vectors import Line, Vec3

steps = st.lists(st.tuples(st.floats(0.0, 0.2), st.floats(-1.0, 6.0)), min_size=1, max_size=200)
speeds, accels = st.floats(0.3, 5.0), st.floats(0.5, 3.0)


@given(st.floats(0.01, 50.0), speeds, accels, st.floats(0.5, 5.0), st.floats(-2.0, 8.0), steps)
def test_speed_and_acceleration_stay_within_limits_whatever_the_follower_does(length, speed, accel, lead, initial, course):
    line = Line(Vec3(1.0, 2.0, 3.0), Vec3(1.0 + length, 2.0, 3.0))
    carrot = LineCarrot(line, speed_m_s=speed, accel_m_s2=accel, lead_m=lead, initial_speed_m_s=initial)
    assert carrot.speed_m_s <= speed
    before_m, before_m_s = carrot.travelled_m, carrot.speed_m_s
    for dt_s, ahead_m in course:
        carrot.step(line.at(carrot.travelled_m + ahead_m - 2.0), dt_s)
        moved_m = carrot.travelled_m - before_m
        assert -1e-9 <= moved_m <= speed * dt_s + 1e-9
        assert 0.0 <= carrot.travelled_m <= length + 1e-9
        assert carrot.speed_m_s - before_m_s <= accel * dt_s + 1e-9
        if carrot.travelled_m < length:
            assert before_m_s - carrot.speed_m_s <= accel * dt_s + 1e-9
        before_m, before_m_s = carrot.travelled_m, carrot.speed_m_s


@given(st.floats(0.01, 50.0), speeds, accels)
def test_arrives_softly_in_the_time_of_a_trapezoid(length, speed, accel):
    line = Line(Vec3(), Vec3(0.0, length, 0.0))
    carrot = LineCarrot(line, speed_m_s=speed, accel_m_s2=accel, lead_m=speed**2 / (2 * accel) + 1.0)
    ramp_m = min(speed**2 / accel, length)
    expected_s = 2.0 * math.sqrt(ramp_m / accel) + (length - ramp_m) / speed
    time_s, last_m_s = 0.0, 0.0
    while carrot.travelled_m < length:
        last_m_s = carrot.speed_m_s
        carrot.step(carrot.point, 0.05)
        time_s += 0.05
        assert time_s < expected_s + 1.0
    assert time_s >= expected_s - 0.2
    assert last_m_s <= accel * 0.05 * 2 + 1e-9 or length < 0.05


@given(speeds, accels, st.floats(0.5, 5.0))
def test_waits_at_its_lead_for_a_follower_that_stands(speed, accel, lead):
    carrot = LineCarrot(Line(Vec3(), Vec3(100.0, 0.0, 0.0)), speed_m_s=speed, accel_m_s2=accel, lead_m=lead)
    for _ in range(500):
        carrot.step(Vec3(), 0.05)
    assert carrot.travelled_m == pytest.approx(lead, abs=0.01)


@given(st.floats(-3.1, 3.1), st.floats(-20.0, 20.0), st.floats(0.05, 1.5))
def test_heading_turns_the_short_way_at_its_rate(start, target, rate):
    carrot = HeadingCarrot(start)
    carrot.turn(target, rate)
    to_go = abs(wrap(target - start))
    turned, yaw = 0.0, start
    for _ in range(math.ceil(to_go / (rate * 0.05)) + 1):
        after = carrot.step(yaw, 0.05)
        assert abs(wrap(after - yaw)) <= rate * 0.05 + 1e-9
        turned += abs(wrap(after - yaw))
        yaw = after
    assert wrap(yaw - target) == pytest.approx(0.0, abs=1e-9)
    assert turned == pytest.approx(to_go, abs=1e-6)


@given(st.floats(-3.1, 3.1), st.floats(0.05, 1.5))
def test_heading_waits_for_a_nose_that_does_not_turn(target, rate):
    carrot = HeadingCarrot(0.0)
    carrot.turn(target, rate)
    for _ in range(500):
        carrot.step(0.0, 0.05)
    assert abs(carrot.yaw_rad) == pytest.approx(min(abs(target), HeadingCarrot.LEAD_RAD), abs=1e-6)


def test_rest_starts_again_from_standstill():
    carrot = LineCarrot(Line(Vec3(), Vec3(10.0, 0.0, 0.0)), speed_m_s=2.0, accel_m_s2=1.0, lead_m=5.0, initial_speed_m_s=2.0)
    carrot.step(Vec3(), 0.1)
    carrot.rest_at(4.0)
    assert carrot.point == Vec3(4.0, 0.0, 0.0)
    carrot.step(Vec3(4.0, 0.0, 0.0), 0.1)
    assert carrot.speed_m_s == pytest.approx(0.1)
