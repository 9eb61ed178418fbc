"""What rays and distances meet in a world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alula.common.open3d_core import o3d
from uav_simulator.frames import Vec3
from uav_simulator.world.parts import Part
from uav_simulator.world.shapes import Floats, merged

Floats32 = NDArray[np.float32]
UInts = NDArray[np.uint32]
NO_HIT = 0xFFFFFFFF


@dataclass(frozen=True)
class Hits:
    """Where rays end: ``range_m`` (N,) float32, inf without a hit; ``triangle`` (N,) uint32, NO_HIT without."""

    range_m: Floats32
    triangle: UInts


@dataclass(frozen=True)
class Nearest:
    """The surface nearest to a point: distance in metres, closest point in map."""

    distance_m: float
    point: Vec3


class Scene:
    """Triangles of one world in map (ENU, metres); the ground's come first."""

    def __init__(self, parts: list[Part]) -> None:
        mesh = merged([p.mesh for p in parts])
        self.vertices: Floats = mesh.vertices
        self.triangles = mesh.triangles
        self.brightness = np.concatenate([np.full(len(p.mesh.triangles), p.brightness) for p in parts])
        corners = self.vertices[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.normals: Floats = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        self.plane_offsets: Floats = np.einsum("ij,ij->i", self.normals, corners[:, 0])
        self._all = _scene(self.vertices, self.triangles)
        obstacles = self.triangles[len(parts[0].mesh.triangles) :]
        self._obstacles = _scene(self.vertices, obstacles) if len(obstacles) else None

    def cast(self, rays: Floats32, *, threads: int = 1) -> Hits:
        """Cast rays (N, 6) float32 (origin, direction, map); ranges are in units of the direction's length."""
        answer = self._all.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=threads)
        return Hits(answer["t_hit"].numpy(), answer["primitive_ids"].numpy())

    def nearest(self, position: Vec3) -> Nearest:
        """Return the nearest surface, the ground included."""
        return _nearest(self._all, position)

    def nearest_obstacle(self, position: Vec3) -> Nearest:
        """Return the nearest surface that is not the ground; infinitely far where there is none."""
        return Nearest(math.inf, position) if self._obstacles is None else _nearest(self._obstacles, position)


def _scene(vertices: Floats, triangles: NDArray[np.int64]) -> Any:
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32)))
    return scene


def _nearest(scene: Any, position: Vec3) -> Nearest:
    query = o3d.core.Tensor.from_numpy(np.array([position], dtype=np.float32))
    x, y, z = scene.compute_closest_points(query, nthreads=1)["points"].numpy()[0].tolist()
    distance = ((x - position[0]) ** 2 + (y - position[1]) ** 2 + (z - position[2]) ** 2) ** 0.5
    return Nearest(distance, (x, y, z))
