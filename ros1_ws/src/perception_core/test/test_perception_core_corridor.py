"""The corridor ahead: what is in it, what is nearest, what is not believed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception_core import Corridor, Support, VehicleMotion, direction_of_motion
from perception_core.nearest import nearest_obstacle

EAST = np.array([1.0, 0.0, 0.0])
ORIGIN = np.array([0.0, 0.0, 3.0])
BOX = Corridor()


def blob(ahead, left=0.0, up=0.0, *, count=20, size=0.1, seed=0) -> np.ndarray:
    return ORIGIN + np.array([ahead, left, up]) + np.random.default_rng(seed).uniform(-size / 2, size / 2, (count, 3))


def look(points, support=None, **corridor):
    return nearest_obstacle(points, ORIGIN, EAST, Corridor(**corridor), support or Support())


@given(st.floats(1.0, 7.5), st.floats(-1.1, 1.1), st.floats(-0.5, 0.5), st.integers(0, 1000))
@settings(max_examples=80)
def test_a_blob_anywhere_in_the_corridor_is_found_at_its_distance(ahead, left, up, seed) -> None:
    found = look(blob(ahead, left, up, seed=seed))
    assert found is not None
    assert found.distance_m == pytest.approx(ahead, abs=0.06)
    assert np.linalg.norm(np.array(found.point_enu_m) - ORIGIN - [ahead, left, up]) < 0.1


def test_the_size_is_of_the_connected_thing_and_not_of_what_stands_apart() -> None:
    rng = np.random.default_rng(4)
    plank = ORIGIN + np.array([4.0, 0.0, 0.0]) + rng.uniform([-0.05, -0.8, -0.1], [0.05, 0.8, 0.1], (800, 3))
    found = look(np.vstack([plank, blob(6.5)]))
    assert found is not None
    assert found.size_m == pytest.approx((0.1, 1.6, 0.2), abs=0.08)


@pytest.mark.parametrize(
    ("ahead", "left", "up"), [(4, 1.4, 0), (4, -1.4, 0), (4, 0, 0.75), (4, 0, -0.75), (8.2, 0, 0), (-2, 0, 0), (0.1, 0, 0)]
)
def test_what_is_outside_is_no_obstacle(ahead, left, up) -> None:
    assert look(blob(ahead, left, up)) is None


def test_ground_is_no_obstacle_even_when_the_vehicle_is_low() -> None:
    rng = np.random.default_rng(1)
    ground = np.column_stack([rng.uniform(-8, 8, (4000, 2)), rng.normal(0.0, 0.03, 4000)])
    assert nearest_obstacle(ground, np.array([0.0, 0.0, 0.5]), EAST, BOX, Support()) is None


@given(st.floats(-math.pi, math.pi), st.floats(-50, 50), st.floats(-50, 50), st.integers(0, 10_000))
@settings(max_examples=60)
def test_turning_and_moving_the_whole_scene_changes_nothing(angle, x, y, seed) -> None:
    rng = np.random.default_rng(seed)
    points = np.vstack([blob(rng.uniform(2, 7), rng.uniform(-2, 2), seed=seed), rng.uniform(-9, 9, (40, 3)) + ORIGIN])
    before = look(points)
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([x, y, 0.0])
    after = nearest_obstacle(points @ turn.T + shift, turn @ ORIGIN + shift, turn @ EAST, BOX, Support())
    assert (before is None) == (after is None)
    if before is not None and after is not None:
        assert after.distance_m == pytest.approx(before.distance_m, abs=1e-6)


def test_single_outliers_before_an_obstacle_do_not_stop_the_vehicle() -> None:
    outliers = np.array([[2.0, 0.5, 0.2], [3.0, -0.7, -0.3], [1.5, 0.0, 0.4]]) + ORIGIN
    assert look(outliers) is None
    found = look(np.vstack([outliers, blob(6.0)]))
    assert found is not None
    assert found.distance_m == pytest.approx(6.0, abs=0.1)


@given(st.floats(0.35, 7.9), st.floats(-1.2, 1.2), st.floats(-0.55, 0.55))
@settings(max_examples=100)
def test_three_close_returns_suffice_wherever_the_cells_cut_them(ahead, left, up) -> None:
    three = ORIGIN + np.array([ahead, left, up]) + np.array([[0.0, 0.0, 0.0], [0.03, 0.02, 0.03], [0.02, -0.03, -0.03]])
    assert look(three) is not None


def test_small_surfaces_are_not_believed_by_a_camera() -> None:
    points = blob(4.0, count=40)
    support = Support(min_points=6, min_area_m2=0.02)
    small, large = np.full(40, 0.0001), np.full(40, 0.001)
    assert nearest_obstacle(points, ORIGIN, EAST, BOX, support, small) is None
    assert nearest_obstacle(points, ORIGIN, EAST, BOX, support, large) is not None


def test_points_without_depth_are_left_out() -> None:
    found = look(np.vstack([np.full((30, 3), np.nan), blob(5.0)]))
    assert found is not None
    assert found.distance_m == pytest.approx(5.0, abs=0.1)


def test_direction_is_of_the_velocity_then_of_the_target_then_of_the_nose() -> None:
    nose = np.array([0.0, 1.0, 0.1])
    sideways = VehicleMotion(velocity_enu_m_s=(-1.1, 0.0, 0.3), target_enu_m=(9.0, 0.0, 3.0))
    assert direction_of_motion(ORIGIN, nose, sideways) == pytest.approx([-1.0, 0.0, 0.0])
    slow = VehicleMotion(velocity_enu_m_s=(-0.1, 0.0, 2.0), target_enu_m=(9.0, 0.0, 5.0))
    assert direction_of_motion(ORIGIN, nose, slow) == pytest.approx([1.0, 0.0, 0.0])
    there = VehicleMotion(target_enu_m=(0.1, 0.0, 9.0))
    assert direction_of_motion(ORIGIN, nose, there) == pytest.approx([0.0, 1.0, 0.0])
    assert direction_of_motion(ORIGIN, nose, VehicleMotion()) == pytest.approx([0.0, 1.0, 0.0])


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.5, 30.0))
def test_a_push_by_the_wind_is_no_way(towards_m_s, aside_m_s, to_go_m) -> None:
    """Slowly aside or back: the way is to the target. By more than 1 m/s: it is where the vehicle goes."""
    target = (to_go_m, 0.0, 3.0)
    found = direction_of_motion(ORIGIN, EAST, VehicleMotion((towards_m_s, aside_m_s, 0.0), target))
    pushed_m_s = math.hypot(min(towards_m_s, 0.0), aside_m_s)
    speed_m_s = math.hypot(towards_m_s, aside_m_s)
    if abs(pushed_m_s - 1.0) > 1e-6:
        own = [towards_m_s / speed_m_s, aside_m_s / speed_m_s, 0.0] if pushed_m_s > 1.0 else [1.0, 0.0, 0.0]
        assert found == pytest.approx(own, abs=1e-6)
