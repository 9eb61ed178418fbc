"""Physics and control of the hexacopter."""

import math
import statistics
import time

import pytest

from uav_simulator.frames import Quat
from uav_simulator.imperfections import Imperfections
from uav_simulator.vehicle.airframe import GRAVITY_M_S2, ROTORS, Airframe
from uav_simulator.vehicle.controller import OFF, AttitudeTarget, Gains, PositionLoop, Reference
from uav_simulator.vehicle.hexacopter import STEP_S, Hexacopter
from uav_simulator.vehicle.noise import SlowNoise, Wind
from uav_simulator.vehicle.quaternion import from_yaw, rotate, tilted
from uav_simulator.vehicle.rigid_body import RigidBody
from uav_simulator.vehicle.shaping import Limits, Shaper

FRAME = Airframe()
NO_DRAG = Airframe(drag_linear_kg_s=0.0, drag_square_kg_m=0.0, spin_drag_n_m_s=0.0)
LEVEL: Quat = from_yaw(0.0)
ZERO = (0.0, 0.0, 0.0)


def test_free_fall_without_drag_keeps_its_energy():
    body = RigidBody(NO_DRAG, (0.0, 0.0, 100.0))
    body.velocity = (3.0, 0.0, 0.0)
    energy = 0.5 * 9.0 + GRAVITY_M_S2 * 100.0
    for _ in range(800):
        body.step(STEP_S, OFF)
    assert 0.5 * sum(v * v for v in body.velocity) + GRAVITY_M_S2 * body.position[2] == pytest.approx(energy, rel=1e-3)
    assert body.specific_force == pytest.approx(ZERO, abs=1e-9)


def test_spinning_without_torque_keeps_its_angular_momentum():
    body = RigidBody(NO_DRAG, (0.0, 0.0, 500.0))
    body.rates = (1.0, 0.5, 2.0)

    def momentum():
        return rotate(body.attitude, tuple(i * w for i, w in zip(NO_DRAG.inertia_kg_m2, body.rates, strict=True)))

    before = momentum()
    for _ in range(400):
        body.step(STEP_S, OFF)
    assert momentum() == pytest.approx(before, rel=0.02, abs=0.02)


def test_equal_thrusts_that_carry_the_weight_hover():
    body = RigidBody(FRAME, (0.0, 0.0, 5.0))
    body.thrusts = (FRAME.hover_thrust_n / ROTORS,) * ROTORS
    for _ in range(400):
        body.step(STEP_S, body.thrusts)
    assert body.position == pytest.approx((0.0, 0.0, 5.0), abs=1e-6)
    assert body.specific_force == pytest.approx((0.0, 0.0, GRAVITY_M_S2), abs=1e-6)


def test_rotors_follow_with_a_lag_and_saturate():
    body = RigidBody(FRAME, (0.0, 0.0, 50.0))
    for _ in range(round(FRAME.rotor_lag_s / STEP_S)):
        body.step(STEP_S, (1000.0,) * ROTORS)
    assert body.thrusts[0] == pytest.approx(FRAME.rotor_max_n * (1 - math.exp(-1)), rel=0.03)


@pytest.mark.parametrize(("axis", "tilt"), [(0, (0.0, -0.2)), (1, (0.2, 0.0))])
def test_an_attitude_step_settles_without_much_overshoot(axis, tilt):
    vehicle = Hexacopter(FRAME, None, (0.0, 0.0, 50.0))
    up = (tilt[0], tilt[1], math.sqrt(1 - tilt[0] ** 2 - tilt[1] ** 2))
    vehicle.target = AttitudeTarget(tilted(up, 0.0), 0.0, FRAME.hover_thrust_n)
    tilts = []
    for _ in range(100):
        vehicle.advance(0.02)
        x, y, _ = rotate(vehicle.body.attitude, (0.0, 0.0, 1.0))
        tilts.append(math.hypot(x, y))
    assert max(tilts) < 0.2 * 1.2
    assert tilts[40] == pytest.approx(0.2, abs=0.02), "within 0.8 s"
    other = rotate(vehicle.body.attitude, (0.0, 0.0, 1.0))[axis]
    assert abs(other) < 0.005


def fly(vehicle, target, seconds, *, yaw=0.0):
    """Hold the vehicle's shaped way to a target; return the largest error to the shaped way."""
    loop, xy, z = PositionLoop(FRAME, Gains()), Shaper(vehicle.body.position[:2]), Shaper(vehicle.body.position[2:])
    error = 0.0
    for _ in range(round(seconds / 0.02)):
        xy.toward(target[:2], (0.0, 0.0), Limits(5.0, 2.5, 5.0, 1.0), 0.02)
        z.toward(target[2:], (0.0,), Limits(2.0, 2.5, 10.0, 2.0), 0.02)
        reference = Reference((*xy.position, *z.position), (*xy.velocity, *z.velocity), (*xy.accel, *z.accel), yaw)
        vehicle.target = loop.step(reference, vehicle.body.position, vehicle.body.velocity, 0.02)
        vehicle.advance(0.02)
        error = max(error, math.dist(vehicle.body.position, reference.position))
    return error


def test_a_position_step_in_wind_is_tracked_and_held():
    vehicle = Hexacopter(FRAME, Wind(seed=3), (0.0, 0.0, 3.0))
    assert fly(vehicle, (10.0, -4.0, 5.0), 15.0) < 0.35
    assert math.dist(vehicle.body.position, (10.0, -4.0, 5.0)) < 0.1


def test_a_shaper_keeps_its_limits_and_arrives():
    limits = Limits(2.0, 1.5, 4.0, 1.0)
    shaper = Shaper((0.0, 0.0))
    last = shaper.accel
    for _ in range(500):
        shaper.toward((6.0, 3.0), (0.0, 0.0), limits, 0.02)
        assert math.hypot(*shaper.velocity) <= 2.0 + 0.12
        assert math.hypot(*shaper.accel) <= 1.5 + 1e-9
        assert math.dist(shaper.accel, last) <= 4.0 * 0.02 + 1e-9
        last = shaper.accel
    assert shaper.position == pytest.approx((6.0, 3.0), abs=0.01)


def test_slow_noise_has_its_size_and_repeats_with_its_seed():
    def series(seed):
        noise = SlowNoise(sigma=1.0, tau_s=0.5, limit=2.0, seed=seed)
        return [noise.step(0.02) for _ in range(20000)]

    first = series("a")
    assert first == series("a")
    assert first != series("b")
    values = [v[0] for v in first]
    assert max(abs(v) for v in values) <= 2.0
    assert math.sqrt(sum(v * v for v in values) / len(values)) == pytest.approx(0.93, abs=0.12)


def test_on_the_ground_without_motors_nothing_moves():
    vehicle = Hexacopter(FRAME, Wind(seed=1))
    vehicle.advance(1.0)
    assert vehicle.body.position == (0.0, 0.0, 0.0)
    assert vehicle.body.on_ground


def test_a_bounce_leaves_the_surface_and_loses_the_speed_into_it():
    body = RigidBody(FRAME, (0.0, 0.0, 3.0))
    body.velocity = (1.0, 0.5, 0.0)
    body.bounce((-1.0, 0.0, 0.0), 0.1)
    assert body.velocity == pytest.approx((-0.2, 0.5, 0.0))
    assert body.position == pytest.approx((-0.1, 0.0, 3.0))


def test_a_simulated_second_costs_less_than_15_percent_of_a_core():
    vehicle = Hexacopter(FRAME, Wind(seed=1), (0.0, 0.0, 3.0))
    start = time.process_time()
    fly(vehicle, (1.0, 0.0, 3.0), 4.0)
    assert (time.process_time() - start) / 4.0 < 0.15


def test_a_stronger_wind_blows_from_the_same_side_and_a_weaker_one_is_the_usual():
    def mean(**imperfections):
        wind = Wind.of(Imperfections(**imperfections), 4)
        values = [wind.step(0.02) for _ in range(30_000)]
        return [sum(value[axis] for value in values) / len(values) for axis in range(2)], values

    (east, north), values = mean(wind_m_s=8.0, gust_m_s=1.5)
    assert math.hypot(east, north) == pytest.approx(8.0, abs=0.4)
    assert statistics.stdev(value[0] for value in values) == pytest.approx(1.5, abs=0.25)
    usual, same = mean()[0], mean(wind_m_s=0.5)[0]
    assert usual == same
    assert math.hypot(*usual) == pytest.approx(1.0, abs=0.15)
    assert math.atan2(usual[1], usual[0]) == pytest.approx(math.atan2(north, east), abs=0.15)
