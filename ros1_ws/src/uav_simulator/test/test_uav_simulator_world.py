"""The yard: a route with room around it for every seed, and true surfaces in a file."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
import yaml

from uav_simulator.autopilot.types import LandedState
from uav_simulator.contacts import ContactMonitor
from uav_simulator.errors import ConfigError
from uav_simulator.settings import Settings
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.rigid_body import RigidBody
from uav_simulator.world import shapes
from uav_simulator.world.config import load_world_config, world_config_from_dict
from uav_simulator.world.ply import write_mesh
from uav_simulator.world.scene import World
from uav_simulator.world.yard import build_parts, distances_to_mesh

YARD = Path(Settings().world)
CONFIG = load_world_config(YARD)
SEEDS = range(12)


def along_route(step_m=0.2):
    pieces = [np.linspace(a, b, math.ceil(math.dist(a, b) / step_m)) for a, b in pairwise(CONFIG.route)]
    return np.concatenate(pieces)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_route_has_room_on_all_sides(seed):
    mesh = shapes.merged([p.mesh for p in build_parts(CONFIG, seed)])
    distance, _ = distances_to_mesh(mesh, along_route())
    assert distance.min() >= 2.3


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_stands_ahead_of_the_end_of_a_leg(seed):
    """Whoever watches ahead must not stop before a corner: 4.5 m beyond each leg a corridor of 2.6 x 2 m is free."""
    world = World(build_parts(CONFIG, seed))
    for a, b in pairwise(CONFIG.route):
        direction = (np.array(b) - np.array(a)) / math.dist(a, b)
        side = np.array([-direction[1], direction[0], 0.0])
        starts = [np.array(b) + y * side + [0, 0, z] for y in np.linspace(-1.3, 1.3, 14) for z in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        rays = np.array([np.concatenate([s, direction]) for s in starts], dtype=np.float32)
        assert world.cast(rays).range_m.min() > 4.5


def test_the_route_is_as_long_as_the_mission_needs_and_within_the_fence():
    legs = [math.dist(a, b) for a, b in pairwise(CONFIG.route)]
    assert 75.0 <= sum(legs) <= 85.0
    assert CONFIG.route[0] == (0.0, 0.0, 3.0)
    assert max(math.dist(p[:2], CONFIG.home[:2]) for p in CONFIG.route) < 60.0
    for (a, b), (_, c) in pairwise(pairwise(CONFIG.route)):
        assert abs(np.dot(np.subtract(b, a), np.subtract(c, b))) < 1e-9, "corners of 90 degrees"


def test_a_lateral_scan_sees_something_on_both_sides():
    world = World(build_parts(CONFIG, 0))
    for a, b in pairwise(CONFIG.route):
        direction = (np.array(b) - np.array(a)) / math.dist(a, b)
        left = np.array([-direction[1], direction[0], 0.0])
        for side in (left, -left):
            points = np.linspace(a, b, 40) - [0.0, 0.0, 1.0]
            rays = np.concatenate([points, np.tile(side, (40, 1))], axis=1).astype(np.float32)
            assert np.mean(world.cast(rays).range_m < 12.0) > 0.5


def test_the_seed_changes_details_and_nothing_else():
    first, again, other = (World(build_parts(CONFIG, seed)) for seed in (4, 4, 5))
    assert np.array_equal(first.vertices, again.vertices)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)
    assert np.allclose(build_parts(CONFIG, 4)[1].mesh.vertices, build_parts(CONFIG, 5)[1].mesh.vertices)


def test_an_obstacle_on_the_route_is_pushed_off_it():
    data = yaml.safe_load(YARD.read_text())
    data["obstacles"] = [{"kind": "pillar", "at": [10.0, 0.3]}]
    parts = build_parts(world_config_from_dict(data, "test"), 0)
    distance, _ = distances_to_mesh(parts[-1].mesh, along_route())
    assert distance.min() >= 2.3


@pytest.mark.parametrize("shape", [shapes.ball(1.0), shapes.cylinder(1.0, 2.0), shapes.box((0, 0, 1), (1, 2, 3))])
def test_normals_point_outward(shape):
    corners = shape.vertices[shape.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centre = (shape.vertices.min(axis=0) + shape.vertices.max(axis=0)) / 2
    assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) - centre) > 0).all()


def test_the_written_surfaces_are_read_by_others(tmp_path):
    world = World(build_parts(CONFIG, 0))
    path = tmp_path / "run" / "world.ply"
    write_mesh(path, world.vertices, world.triangles)
    mesh = o3d.io.read_triangle_mesh(str(path))
    assert np.allclose(np.asarray(mesh.vertices), world.vertices, atol=1e-5)
    assert np.array_equal(np.asarray(mesh.triangles), world.triangles)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"colour": 1}, "unknown key 'colour'"),
        ({"route": [[0, 0, 3]]}, "at least two points"),
        ({"route": [[0, 0], [1, 1, 1]]}, "route[0]"),
        ({"obstacles": [{"kind": "dragon", "at": [1, 2]}]}, "unknown kind 'dragon'"),
        ({"boxes": [{"name": "b", "low": [1, 0, 0], "high": [0, 1, 1]}]}, "`low` must be below `high`"),
        ({"boxes": [{"name": "b", "low": [1, 0, 0]}]}, "key 'high' is missing"),
    ],
)
def test_a_wrong_description_is_refused_with_the_place(change, said):
    with pytest.raises(ConfigError, match="test") as caught:
        world_config_from_dict(yaml.safe_load(YARD.read_text()) | change, "test")
    assert said in str(caught.value)


def test_a_description_that_is_not_there_is_refused():
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: can't be read"):
        load_world_config(Path("nowhere.yaml"))


def body_at(x, y, z):
    body = RigidBody(Airframe(), (x, y, z))
    body.on_ground = False
    return body


def test_contacts_are_counted_once_each_and_clearance_from_the_radius():
    monitor = ContactMonitor(World(build_parts(CONFIG, 0)), 0.85)
    monitor.step(body_at(4.0, -1.0, 1.0), LandedState.TAKING_OFF)
    assert monitor.min_clearance_m == math.inf, "the ground's nearness counts only after the take-off"
    monitor.step(body_at(4.9, -2.3, 3.0), LandedState.IN_AIR)
    assert monitor.collisions == 0
    assert monitor.min_clearance_m == pytest.approx(4.3 - 2.3 - 0.85, abs=0.4)
    for _ in range(3):
        monitor.step(body_at(4.9, -3.9, 3.0), LandedState.IN_AIR)
    assert monitor.collisions == 1
    monitor.step(body_at(4.9, -1.0, 3.0), LandedState.IN_AIR)
    monitor.step(body_at(4.9, -3.9, 3.0), LandedState.IN_AIR)
    assert monitor.collisions == 2
    assert monitor.min_clearance_m < 0.0


def test_landing_is_no_contact_and_flying_into_the_ground_is():
    monitor = ContactMonitor(World(build_parts(CONFIG, 0)), 0.85)
    monitor.step(body_at(0.0, 0.0, 3.0), LandedState.IN_AIR)
    monitor.step(body_at(0.0, 0.0, 0.3), LandedState.LANDING)
    assert monitor.collisions == 0
    assert monitor.min_clearance_m == pytest.approx(2.15)
    monitor.step(body_at(0.0, 0.0, 0.3), LandedState.IN_AIR)
    assert monitor.collisions == 1
