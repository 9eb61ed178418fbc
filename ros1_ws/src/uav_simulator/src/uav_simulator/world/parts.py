"""Build the meshes of a world: fixed boxes as described, obstacles whose details vary with the seed but never block the route."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from alula.common.open3d_core import o3d
from uav_simulator.errors import ConfigError
from uav_simulator.frames import Vec3
from uav_simulator.world.config import Obstacle, Scatter, WorldConfig
from uav_simulator.world.shapes import Floats, Mesh, ball, box, cylinder, merged, rectangle

ROUTE_SAMPLE_M = 0.25
AHEAD_M = 5.0
PUSHES = 12
DRAWS = 40
Rng = np.random.Generator


@dataclass(frozen=True)
class Part:
    """One thing of the world; ``brightness`` is its mean reflectance, 0..1."""

    name: str
    mesh: Mesh
    brightness: float


def route_samples(route: tuple[Vec3, ...]) -> Floats:
    """Return points along the route, (N, 3), at most 0.25 m apart, with the ways up to its start and down from its end."""
    first, last = route[0], route[-1]
    corners = [(first[0], first[1], 0.9), *route, (last[0], last[1], 0.9)]
    return np.concatenate([_line_samples(a, b) for a, b in pairwise(corners)])


def samples_ahead(route: tuple[Vec3, ...]) -> Floats:
    """Return points on the 5 m beyond each leg, (N, 3): a vehicle that watches ahead must not be stopped before a corner."""
    pieces = []
    for a, b in pairwise(np.array(route)):
        pieces.append(_line_samples(b, b + AHEAD_M * (b - a) / max(float(np.linalg.norm(b - a)), 1e-6)))
    return np.concatenate(pieces)


def _line_samples(a: Vec3 | Floats, b: Vec3 | Floats) -> Floats:
    count = max(2, math.ceil(math.dist(a, b) / ROUTE_SAMPLE_M) + 1)
    return np.linspace(a, b, count, dtype=np.float64)


def distances_to_mesh(mesh: Mesh, points: Floats) -> tuple[Floats, Floats]:
    """Return the distance of each point (N, 3) to the mesh, (N,), and the closest points, (N, 3), in metres."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(o3d.core.Tensor(mesh.vertices.astype(np.float32)), o3d.core.Tensor(mesh.triangles.astype(np.uint32)))
    closest = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))["points"].numpy().astype(np.float64)
    return np.linalg.norm(closest - points, axis=1), closest


def pillar(rng: Rng) -> Mesh:
    """Return a pillar of 0.4 to 0.6 m across and 4 to 5.5 m high."""
    return cylinder(rng.uniform(0.2, 0.3), rng.uniform(4.0, 5.5))


def tree(rng: Rng) -> Mesh:
    """Return a trunk with a knobbly crown."""
    height, radius = rng.uniform(3.2, 4.2), rng.uniform(0.9, 1.2)
    crown = ball(radius)
    # Displace by a smooth function of direction, so that the copies of a shared vertex stay together.
    wave = rng.uniform(2.0, 4.0, size=3)
    knobs = 1.0 + 0.12 * np.sin(crown.vertices @ wave + rng.uniform(0.0, 6.0))
    return merged([cylinder(0.15, height), Mesh(crown.vertices * knobs[:, None], crown.triangles).moved((0.0, 0.0, height))])


def crate(rng: Rng) -> Mesh:
    """Return a crate of about a metre, sometimes with a smaller one on top."""
    a, h = rng.uniform(0.4, 0.55), rng.uniform(0.8, 1.2)
    crates = [box((-a, -a, 0.0), (a, a, h))]
    if rng.uniform() < 0.5:
        b = 0.7 * a
        crates.append(box((-b, -b, h), (b, b, h + 0.7)))
    return merged(crates).turned(rng.uniform(-0.6, 0.6))


def container(rng: Rng) -> Mesh:
    """Return a container of 6.1 x 2.4 x 2.6 m, not quite straight."""
    return box((-3.05, -1.2, 0.0), (3.05, 1.2, 2.6)).turned(rng.uniform(-0.05, 0.05))


SHAPES: dict[str, Callable[[Rng], Mesh]] = {"pillar": pillar, "tree": tree, "crate": crate, "container": container}
BRIGHTNESS = {"pillar": 0.55, "tree": 0.35, "crate": 0.6, "container": 0.5}


def place(obstacle: Obstacle, route: Floats, keep_clear_m: float, rng: Rng) -> Mesh:
    """Return the obstacle's mesh in the world, pushed away from the route as far as needed; raises ConfigError when that fails."""
    jitter = rng.uniform(-0.3, 0.3, size=2)
    at = (obstacle.at[0] + jitter[0], obstacle.at[1] + jitter[1], 0.0)
    mesh = SHAPES[obstacle.kind](rng).turned(math.radians(obstacle.turn_deg)).moved(at)
    for _ in range(PUSHES):
        distance, closest = distances_to_mesh(mesh, route)
        i = int(distance.argmin())
        if distance[i] >= keep_clear_m:
            return mesh
        away = closest[i, :2] - route[i, :2]
        away /= max(float(np.linalg.norm(away)), 1e-6)
        push = keep_clear_m - distance[i] + 0.05
        mesh = mesh.moved((away[0] * push, away[1] * push, 0.0))
    raise ConfigError(f"obstacle {obstacle.kind} at {obstacle.at} can't be kept {keep_clear_m} m from the route: move it")


def scatter(entry: Scatter, route: Floats, keep_clear_m: float, rng: Rng) -> Mesh:
    """Return a thing at a random place that is as far from the route as it has to be; raises ConfigError when none is found."""
    mesh = SHAPES[entry.kind](rng).turned(rng.uniform(0.0, math.tau))
    for _ in range(DRAWS):
        there = mesh.moved((rng.uniform(*entry.x), rng.uniform(*entry.y), 0.0))
        distance, _ = distances_to_mesh(there, route)
        if distance.min() >= keep_clear_m:
            return there
    raise ConfigError(f"a scattered {entry.kind} finds no place {keep_clear_m} m from the route in x {entry.x}, y {entry.y}: widen it")


def build_parts(config: WorldConfig, seed: int) -> list[Part]:
    """Return the world's parts, the ground first; the same for the same seed."""
    rng = np.random.default_rng([seed, 1])
    route = route_samples(config.route)
    parts = [Part("ground", rectangle(config.ground.x, config.ground.y), 0.45)]
    parts += [Part(b.name, box(b.low, b.high), 0.5 + 0.2 * rng.uniform()) for b in config.boxes]
    for index, obstacle in enumerate(config.obstacles):
        mesh = place(obstacle, route, config.keep_clear_m, rng)
        parts.append(Part(f"{obstacle.kind} {index}", mesh, BRIGHTNESS[obstacle.kind] * rng.uniform(0.8, 1.2)))
    wide = np.concatenate([route, samples_ahead(config.route)])
    for entry in config.scatter:
        for index in range(entry.count):
            mesh = scatter(entry, wide, config.keep_clear_m, rng)
            parts.append(Part(f"scattered {entry.kind} {index}", mesh, BRIGHTNESS[entry.kind] * rng.uniform(0.8, 1.2)))
    return parts
