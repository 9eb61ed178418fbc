"""The map's error and coverage, where both are known by hand."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from alula.report.files import Problems, ReportError
from uav_report.map_picture import FROM_ABOVE, FROM_SOUTH, topmost
from uav_report.map_quality import covered_by, error_m, judge_map, load_map, load_route, patches_in_reach, viewpoints
from uav_report.world import TrueSurfaces

sys.path.insert(0, str(Path(__file__).parent))
from test_report_sample import mesh_of, write_map, write_world

GROUND = ([-30, -30], [30, 30])
ROUTE = np.array([[-10.0, 0.0, 3.0], [10.0, 0.0, 3.0]])


def plain() -> TrueSurfaces:
    return TrueSurfaces(*mesh_of([], GROUND))


def grid(x, y, z=0.0, step=0.2):
    xs, ys = np.meshgrid(np.arange(*x, step), np.arange(*y, step))
    return np.stack([xs.ravel(), ys.ravel(), np.full(xs.size, z)], axis=1)


def test_error_is_the_distance_to_the_nearest_surface():
    assert error_m(grid((-5, 5), (-5, 5), z=0.12), plain()) == pytest.approx(0.12, abs=1e-5)
    mixed = np.concatenate([grid((-5, 5), (-5, 5), z=0.3), grid((-5, 5), (-5, 5), z=0.0)])
    assert error_m(mixed, plain()) == pytest.approx(0.3 / np.sqrt(2), abs=1e-5)


def test_patches_lie_evenly():
    patches, normals = plain().sample(0.25, seed=1)
    assert len(patches) == pytest.approx(60 * 60 / 0.25**2, abs=1)
    quarter = (patches[:, 0] > 0) & (patches[:, 1] > 0)
    assert quarter.mean() == pytest.approx(0.25, abs=0.01)
    np.testing.assert_allclose(np.abs(normals[:, 2]), 1.0)


def test_reach_is_a_band_beside_the_route():
    patches = patches_in_reach(plain(), ROUTE)
    beside = patches[np.abs(patches[:, 0]) < 9]
    assert np.abs(beside[:, 1]).max() == pytest.approx(10.0, abs=0.1)
    # Before and behind the legs only what lies within 30 degrees of the plane across the ends.
    x, y = np.abs(patches[:, 0]) - 10, np.hypot(patches[:, 1], 3.0)
    assert (x <= y * np.tan(np.radians(30)) + 1e-6).all()
    inside = (np.abs(patches[:, 0]) <= 10) & (np.abs(patches[:, 1]) <= 9.5)
    assert inside.sum() == pytest.approx(20 * 19 / 0.25**2, rel=0.02)


def test_what_is_hidden_is_not_in_reach():
    wall = ((-30, 5.0, 0), (30, 5.2, 6))
    patches = patches_in_reach(TrueSurfaces(*mesh_of([wall], GROUND)), ROUTE)
    assert (patches[:, 1] < 5.02).all(), "neither the wall's back nor the ground behind it"
    assert (np.abs(patches[patches[:, 2] > 0.1][:, 1] - 5.0) < 0.02).all(), "of the wall its front; the top is above the route"
    assert patches[:, 2].max() > 5.9


@pytest.mark.parametrize(("upto", "expected"), [(10.5, 1.0), (0.0, 0.5), (-11.0, 0.0)])
def test_coverage_is_the_mapped_part(upto, expected):
    points = np.concatenate([grid((-22, 22), (-11, max(upto, -10.9)))[:, :], [[100.0, 100.0, 0.0]]])
    quality = judge_map(points if upto > -11 else points[-1:], ROUTE, plain(), Problems())
    assert quality.coverage == pytest.approx(expected, abs=0.015)
    assert len(quality.missed_enu_m) == round((1 - quality.coverage) * quality.in_reach)


@settings(max_examples=20)
@given(st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-1, 4)), min_size=1, max_size=30))
def test_more_points_never_cover_less(places):
    patches = patches_in_reach(plain(), ROUTE)[::50]
    points = np.array(places)
    fewer, more = covered_by(points[: len(points) // 2 + 1], patches), covered_by(points, patches)
    assert not (fewer & ~more).any()
    near = np.linalg.norm(patches[:, None] - points[None], axis=2).min(axis=1) <= 0.25
    assert (near == more).all()


def test_viewpoints_are_a_metre_apart_and_look_along_their_leg():
    places, along = viewpoints(np.array([[0, 0, 3], [2.5, 0, 3], [2.5, 4, 3]], dtype=float))
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= 1.0
    np.testing.assert_allclose(places[[0, -1]], [[0, 0, 3], [2.5, 4, 3]])
    corner = along[np.linalg.norm(places - [2.5, 0, 3], axis=1) < 1e-9]
    np.testing.assert_allclose(corner, [[1, 0, 0], [0, 1, 0]])
    lone, nowhere = viewpoints(np.array([[1.0, 2.0, 3.0]]))
    np.testing.assert_allclose(lone, [[1, 2, 3]])
    np.testing.assert_allclose(nowhere, 0)


def test_without_route_or_world_there_is_still_a_count():
    points = grid((-5, 5), (-5, 5), z=0.1)
    assert judge_map(points, ROUTE, None, Problems()).points == len(points)
    assert judge_map(points, None, plain(), Problems()).rmse_m == pytest.approx(0.1, abs=1e-5)
    assert judge_map(None, ROUTE, plain(), Problems()).points is None
    problems = Problems()
    assert judge_map(points, ROUTE + np.array([0, 0, 90]), plain(), problems).coverage is None
    assert problems.sentences == ["no surface is in reach of the planned route: the map's coverage means nothing"]


def test_files_are_read_or_refused(tmp_path):
    write_map(tmp_path / "map.ply", np.array([[1.0, 2.0, 3.0], [np.nan, 0, 0]]))
    np.testing.assert_allclose(load_map(tmp_path / "map.ply"), [[1, 2, 3]])
    whole = (tmp_path / "map.ply").read_bytes()
    for name, content in {"empty.ply": b"", "text.ply": b"no cloud", "cut.ply": whole[:60]}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ReportError, match=name):
            load_map(tmp_path / name)
        with pytest.raises(ReportError, match=name):
            TrueSurfaces.load(tmp_path / name)
    with pytest.raises(ReportError, match=r"nothing.ply is missing"):
        TrueSurfaces.load(tmp_path / "nothing.ply")
    for route in ([], {}, [[1, 2]], [[1, 2, "x"]], [[1, 2, math.nan]]):
        with pytest.raises(ReportError, match="route"):
            load_route({"inputs": {"route": route}})
    for mission in ({}, {"inputs": 3}):
        with pytest.raises(ReportError, match="route"):
            load_route(mission)
    np.testing.assert_allclose(load_route({"inputs": {"frame": "map", "route": [[0, 0, 3], [1, 0, 3]]}}), [[0, 0, 3], [1, 0, 3]])


def test_the_outline_of_a_box_is_its_twelve_edges(tmp_path):
    write_world(tmp_path / "world.ply", [((0, 0, 0), (2, 3, 4))], None)
    outline = TrueSurfaces.load(tmp_path / "world.ply").outline()
    assert len(outline) == 12
    assert np.linalg.norm(np.diff(outline, axis=1), axis=2).sum() == pytest.approx(4 * (2 + 3 + 4), abs=1e-5)


def test_the_picture_shows_what_hides_the_rest():
    points = np.array([[0.05, 0.05, 1.0], [0.05, 0.05, 2.0], [0.05, 0.9, 2.0], [5.0, 0.0, 0.0]])
    box = (np.zeros(3), np.array([1.5, 1.5, 3.0]))
    assert topmost(points, FROM_ABOVE, box)[0, 0] == 2.0
    assert np.isfinite(topmost(points, FROM_ABOVE, box)).sum() == 2
    assert topmost(points, FROM_SOUTH, box).shape == (20, 10)
    assert np.isfinite(topmost(points, FROM_SOUTH, box)).sum() == 2


def test_a_yard_of_60_by_40_m_takes_seconds():
    random = np.random.default_rng(3)
    corners = random.uniform([-30, -20, 0], [28, 18, 0], (60, 3))
    world = TrueSurfaces(*mesh_of([(low, low + np.array([2.0, 2.0, 5.0])) for low in corners], ([-30, -20], [30, 20])))
    route = np.array([[-28.0, -15, 4], [28, -15, 4], [28, 0, 4], [-28, 0, 4], [-28, 15, 4], [28, 15, 4]])
    began = time.process_time()
    judge_map(random.uniform([-30, -20, 0], [30, 20, 5], (300_000, 3)), route, world, Problems())
    assert time.process_time() - began < 8.0
