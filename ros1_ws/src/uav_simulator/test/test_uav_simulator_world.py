"""Worlds: a route with room around it for every seed, and true surfaces in a file."""

import math
import re
from itertools import pairwise

import numpy as np
import open3d as o3d
import pytest
import yaml

from uav_simulator.autopilot.types import LandedState
from uav_simulator.contacts import ContactMonitor
from uav_simulator.errors import ConfigError
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.rigid_body import RigidBody
from uav_simulator.world import shapes
from uav_simulator.world.config import find_world, load_world, world_names
from uav_simulator.world.parts import build_parts, distances_to_mesh
from uav_simulator.world.ply import write_mesh
from uav_simulator.world.radio import RadioQuality, radio_zone_at
from uav_simulator.world.scene import Scene

YARD = find_world("yard")
CONFIG = load_world(YARD)
WORLDS = [load_world(find_world(name)) for name in world_names()]
SEEDS = [(CONFIG, seed) for seed in range(12)] + [(world, seed) for world in WORLDS for seed in range(2) if world != CONFIG]
SEED_NAMES = [f"{world.name}-{seed}" for world, seed in SEEDS]


def along_route(config, step_m=0.2):
    pieces = [np.linspace(a, b, math.ceil(math.dist(a, b) / step_m)) for a, b in pairwise(config.route)]
    return np.concatenate(pieces)


@pytest.mark.parametrize(("config", "seed"), SEEDS, ids=SEED_NAMES)
def test_the_route_has_room_on_all_sides_and_ahead_of_each_leg(config, seed):
    """A watching sensor must not stop the vehicle before a corner: 4.5 m beyond each level leg a corridor of 2.6 x 2 m is free."""
    world = Scene(build_parts(config, seed))
    distance, _ = distances_to_mesh(shapes.Mesh(world.vertices, world.triangles), along_route(config))
    assert distance.min() >= config.keep_clear_m - 0.1
    for a, b in pairwise(config.route):
        if math.dist(a[:2], b[:2]) < 1.0:
            continue
        direction = (np.array(b) - np.array(a)) / math.dist(a, b)
        side = np.array([-direction[1], direction[0], 0.0])
        starts = [np.array(b) + y * side + [0, 0, z] for y in np.linspace(-1.3, 1.3, 14) for z in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        rays = np.array([np.concatenate([s, direction]) for s in starts], dtype=np.float32)
        assert world.cast(rays).range_m.min() > 4.5


@pytest.mark.parametrize("config", WORLDS, ids=lambda config: config.name)
def test_the_route_is_within_the_fence_and_turns_by_right_angles(config):
    legs = [math.dist(a, b) for a, b in pairwise(config.route)]
    assert 50.0 <= sum(legs) <= 170.0
    assert config.route[0] == (0.0, 0.0, 3.0)
    assert config.home == (0.0, 0.0, 0.0)
    assert max(math.dist(p[:2], config.home[:2]) for p in config.route) < 60.0
    assert max(p[2] for p in config.route) < 20.0
    for (a, b), (_, c) in pairwise(pairwise(config.route)):
        assert abs(np.dot(np.subtract(b, a), np.subtract(c, b))) < 1e-9, "corners of 90 degrees"


def test_a_lateral_scan_sees_something_on_both_sides():
    world = Scene(build_parts(CONFIG, 0))
    for a, b in pairwise(CONFIG.route):
        direction = (np.array(b) - np.array(a)) / math.dist(a, b)
        left = np.array([-direction[1], direction[0], 0.0])
        for side in (left, -left):
            points = np.linspace(a, b, 40) - [0.0, 0.0, 1.0]
            rays = np.concatenate([points, np.tile(side, (40, 1))], axis=1).astype(np.float32)
            assert np.mean(world.cast(rays).range_m < 12.0) > 0.5


def test_the_seed_changes_details_and_nothing_else():
    first, again, other = (Scene(build_parts(CONFIG, seed)) for seed in (4, 4, 5))
    assert np.array_equal(first.vertices, again.vertices)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)
    assert np.allclose(build_parts(CONFIG, 4)[1].mesh.vertices, build_parts(CONFIG, 5)[1].mesh.vertices)


def written(folder, data):
    path = folder / "world.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_an_obstacle_on_the_route_is_pushed_off_it(tmp_path):
    data = yaml.safe_load(YARD.read_text())
    data["obstacles"] = [{"kind": "pillar", "at": [10.0, 0.3]}]
    parts = build_parts(load_world(written(tmp_path, data)), 0)
    distance, _ = distances_to_mesh(parts[-1].mesh, along_route(CONFIG))
    assert distance.min() >= 2.3


@pytest.mark.parametrize("shape", [shapes.ball(1.0), shapes.cylinder(1.0, 2.0), shapes.box((0, 0, 1), (1, 2, 3))])
def test_normals_point_outward(shape):
    corners = shape.vertices[shape.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centre = (shape.vertices.min(axis=0) + shape.vertices.max(axis=0)) / 2
    assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) - centre) > 0).all()


def test_the_written_surfaces_are_read_by_others(tmp_path):
    world = Scene(build_parts(CONFIG, 0))
    path = tmp_path / "run" / "world.ply"
    write_mesh(path, world.vertices, world.triangles)
    mesh = o3d.io.read_triangle_mesh(str(path))
    assert np.allclose(np.asarray(mesh.vertices), world.vertices, atol=1e-5)
    assert np.array_equal(np.asarray(mesh.triangles), world.triangles)
    assert list(path.parent.iterdir()) == [path]


SMALL = """\
name: small
home: [0, 0, 0]
route: [[0, 0, 3], [9, 0, 3]]
keep_clear_m: 2
ground: {x: [-5, 20], y: [-9, 9]}
"""


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("colour: 1", ":6: a world has no `colour`; it may have name"),
        ("boxs: []", "did you mean `boxes`?"),
        ("route: []", ":6: a world: `route` is given twice"),
        ("obstacles: [{kind: dragon, at: [1, 2]}]", ":6: the kind of an obstacle is `dragon`; it may be pillar"),
        ("obstacles: {kind: tree}", ":6: `obstacles` should be a list"),
        ("boxes:\n  - {name: b, low: [1, 0, 0], high: [0, 1, 1]}", ":7: box 'b': `low` must be below `high`"),
        ("boxes:\n  - {name: b, low: [1, 0, 0]}", ":7: box 'b' needs `high`"),
        ("boxes: [{name: b, low: [1, .nan, 0], high: [2, 2, 2]}]", "a coordinate of `low` should be a number"),
        ("boxes: [{name: b, low: [1, 0], high: [2, 2, 2]}]", "`low` should have 3 numbers, not 2"),
        ("scatter: [{kind: tree, count: 2.5, x: [0, 1], y: [0, 1]}]", "`count` should be a whole number"),
        ("scatter: [{kind: tree, count: 2, x: [1, 0], y: [0, 1]}]", "`x`: 1 should be below 0"),
        (
            "radio_zones: [{name: z, quality: bad, sphere: {at: [0, 0, 0], radius_m: 1}}]",
            "`quality` is `bad`; it may be good, degraded, critical",
        ),
        ("radio_zones: [{name: z, quality: good}]", "a radio zone needs one of box, cylinder, sphere; this one has none"),
        ("radio_zones: [{name: z, quality: good, sphere: {at: [0, 0, 0], radius_m: -1}}]", "`radius_m` should be a number from 0.01"),
        ("radio_zones:\n- {name: z, quality: good, cylinder: {at: [0, 0], radius_m: 1}}", ":7: `cylinder` needs `z`"),
        ("boxes: [", "is no YAML"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(more, said, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(SMALL + more + "\n")
    with pytest.raises(ConfigError, match=re.escape(str(path))) as caught:
        load_world(path)
    assert said in str(caught.value)


def test_a_world_of_nothing_but_ground_can_be_flown_in(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(SMALL)
    world = Scene(build_parts(load_world(path), 0))
    assert world.nearest_obstacle((0.0, 0.0, 3.0)).distance_m == math.inf
    assert world.nearest((0.0, 0.0, 3.0)).distance_m == pytest.approx(3.0)
    path.write_text("")
    with pytest.raises(ConfigError, match="is empty; a world needs name"):
        load_world(path)


def test_worlds_are_found_by_name_and_by_file(tmp_path):
    assert find_world("forest").name == "forest.yaml"
    path = tmp_path / "mine.yaml"
    path.write_text(SMALL)
    assert find_world(str(path)) == path
    with pytest.raises(ConfigError, match=r"no world 'forrest': give a file, or one of building, .*did you mean `forest`"):
        find_world("forrest")


def test_radio_zones_are_volumes_and_the_first_that_contains_a_point_counts(tmp_path):
    path = tmp_path / "mine.yaml"
    zones = [
        "{name: core, quality: critical, sphere: {at: [10, 0, 3], radius_m: 2}}",
        "{name: rim, quality: degraded, cylinder: {at: [10, 0], radius_m: 5, z: [1, 6]}}",
        "{name: hall, quality: good, box: {low: [8, 3, 0], high: [20, 9, 9]}}",
    ]
    path.write_text(SMALL + "radio_zones:\n" + "".join(f"  - {zone}\n" for zone in zones))
    zones = load_world(path).radio_zones
    points = {"core": (10, 1.9, 3), "rim": (10, 4.0, 3), "hall": (12, 6.0, 8), None: (10, 0, 7)}
    for name, point in points.items():
        zone = radio_zone_at(zones, point)
        assert (zone.name if zone else None) == name
    assert radio_zone_at(zones, (10, 1.9, 3)).quality is RadioQuality.CRITICAL


def body_at(x, y, z):
    body = RigidBody(Airframe(), (x, y, z))
    body.on_ground = False
    return body


def test_contacts_are_counted_once_each_and_clearance_from_the_radius():
    monitor = ContactMonitor(Scene(build_parts(CONFIG, 0)), 0.85)
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


def test_what_is_far_is_not_looked_for_at_each_moment_and_the_least_clearance_is_exact():
    world = Scene(build_parts(CONFIG, 0))
    monitor, looks, exact_m = ContactMonitor(world, 0.85), [], math.inf
    nearest = world.nearest_obstacle
    world.nearest_obstacle = lambda place: looks.append(place) or nearest(place)
    way = along_route(CONFIG, 0.02)
    for x, y, z in way.tolist():
        monitor.step(body_at(x, y, z), LandedState.IN_AIR)
        exact_m = min(exact_m, nearest((x, y, z)).distance_m - 0.85, z - 0.85)
        assert monitor.min_clearance_m == exact_m
    assert monitor.collisions == 0
    assert len(looks) < len(way) / 4
    monitor.step(body_at(4.9, -3.9, 3.0), LandedState.IN_AIR)
    assert monitor.collisions == 1


def test_landing_is_no_contact_and_flying_into_the_ground_is():
    monitor = ContactMonitor(Scene(build_parts(CONFIG, 0)), 0.85)
    monitor.step(body_at(0.0, 0.0, 3.0), LandedState.IN_AIR)
    monitor.step(body_at(0.0, 0.0, 0.3), LandedState.LANDING)
    assert monitor.collisions == 0
    assert monitor.min_clearance_m == pytest.approx(2.15)
    monitor.step(body_at(0.0, 0.0, 0.3), LandedState.IN_AIR)
    assert monitor.collisions == 1


@pytest.mark.parametrize(
    ("height_m", "state", "collisions"),
    [
        (0.1, LandedState.LANDING, 0),
        (3.0, LandedState.LANDING, 1),
        (3.0, LandedState.ON_GROUND, 1),
        (3.0, LandedState.IN_AIR, 1),
    ],
)
def test_a_vehicle_that_falls_to_the_ground_has_crashed_whatever_its_autopilot_says(height_m, state, collisions):
    monitor = ContactMonitor(Scene(build_parts(CONFIG, 0)), 0.0)
    body = RigidBody(Airframe(), (0.0, 0.0, height_m), ground_decel_m_s2=60.0)
    for _ in range(100):
        for _ in range(8):
            body.step(0.0025, (0.0,) * 6)
        monitor.step(body, LandedState.ON_GROUND if body.on_ground else state)
    assert body.on_ground
    assert monitor.collisions == collisions
    assert monitor.crash.startswith("it met the ground at 7.") == bool(collisions)


@pytest.mark.parametrize(("sink_m_s", "crash"), [(0.5, ""), (2.6, ""), (3.2, "it met the ground at 3.2 m/s")])
def test_a_hard_landing_of_the_pilots_is_no_crash_yet(sink_m_s, crash):
    monitor = ContactMonitor(Scene(build_parts(CONFIG, 0)), 0.85)
    body = body_at(0.0, 0.0, 0.01)
    body.velocity = (0.0, 0.0, -sink_m_s)
    for height_m in (0.01, 0.0):
        body.position = (0.0, 0.0, height_m)
        monitor.step(body, LandedState.LANDING)
    assert (monitor.crash, monitor.collisions) == (crash, 1 if crash else 0)


def test_coming_down_upside_down_is_a_crash():
    monitor = ContactMonitor(Scene(build_parts(CONFIG, 0)), 0.85)
    body = body_at(0.0, 0.0, 0.01)
    body.attitude = (0.0, 1.0, 0.0, 0.0)
    monitor.step(body, LandedState.LANDING)
    body.position = (0.0, 0.0, 0.0)
    monitor.step(body, LandedState.ON_GROUND)
    assert (monitor.crash, monitor.collisions) == ("it met the ground leaning by 180 degrees", 1)


def test_coming_down_on_something_is_a_crash_and_touching_it_in_flight_a_collision():
    for state, height_m, crash in (
        (LandedState.LANDING, 1.0, "it touched something on its way down, 1.0 m above the ground"),
        (LandedState.IN_AIR, 3.0, ""),
        (LandedState.TAKING_OFF, 1.0, ""),
    ):
        monitor = ContactMonitor(Scene(build_parts(CONFIG, 0)), 0.85)
        body = body_at(4.9, -3.9, height_m)
        body.velocity = (0.0, 0.0, -0.5)
        monitor.step(body, state)
        assert (monitor.crash, monitor.collisions) == (crash, 1)
