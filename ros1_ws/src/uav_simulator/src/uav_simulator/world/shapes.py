"""Triangle meshes of simple things. Outward normals; faces that lie on the ground are left out, because no sensor sees them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_simulator.frames import Vec3

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
CYLINDER_SIDES = 12


@dataclass(frozen=True)
class Mesh:
    """Triangles: ``vertices`` (N, 3) float64 in metres, ``triangles`` (M, 3) int64 indices, counter-clockwise seen from outside."""

    vertices: Floats
    triangles: Ints

    def moved(self, offset: Vec3) -> Mesh:
        """Return the mesh shifted by an offset in metres."""
        return Mesh(self.vertices + np.asarray(offset), self.triangles)

    def turned(self, yaw_rad: float) -> Mesh:
        """Return the mesh turned about the z axis through the origin."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        return Mesh(self.vertices @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]), self.triangles)


def merged(meshes: list[Mesh]) -> Mesh:
    """Return one mesh of all triangles."""
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    triangles = [m.triangles + offset for m, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(triangles))


def rectangle(x: tuple[float, float], y: tuple[float, float]) -> Mesh:
    """Return a horizontal rectangle at z = 0, seen from above."""
    corners = np.array([[x[0], y[0], 0.0], [x[1], y[0], 0.0], [x[1], y[1], 0.0], [x[0], y[1], 0.0]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


_BOX_SIDES = [[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
_BOX_TOP = [[4, 5, 6], [4, 6, 7]]
_BOX_BOTTOM = [[0, 2, 1], [0, 3, 2]]


def box(low: Vec3, high: Vec3) -> Mesh:
    """Return an axis-aligned box; without its bottom when it stands on the ground."""
    ring = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    vertices = np.array([(x, y, z) for z in (low[2], high[2]) for x, y in ring])
    bottom = _BOX_BOTTOM if low[2] > 0.0 else []
    return Mesh(vertices, np.array(_BOX_SIDES + _BOX_TOP + bottom))


def cylinder(radius_m: float, height_m: float) -> Mesh:
    """Return an upright prism of 12 sides on the ground, centred on the z axis."""
    n = CYLINDER_SIDES
    angles = np.arange(n) * (2.0 * math.pi / n)
    ring = np.stack([radius_m * np.cos(angles), radius_m * np.sin(angles)], axis=1)
    vertices = np.zeros((2 * n + 1, 3))
    vertices[:n, :2] = ring
    vertices[n : 2 * n, :2] = ring
    vertices[n:, 2] = height_m
    triangles = []
    for i in range(n):
        j = (i + 1) % n
        triangles += [[i, j, n + j], [i, n + j, n + i], [n + i, n + j, 2 * n]]
    return Mesh(vertices, np.array(triangles))


def ball(radius_m: float) -> Mesh:
    """Return a sphere of 80 triangles about the origin: an icosahedron, each triangle split in four."""
    g = (1.0 + math.sqrt(5.0)) / 2.0
    corners = [(0, s1, s2 * g) for s1 in (1, -1) for s2 in (1, -1)]
    points = [np.array(p, dtype=np.float64) for x, y, z in corners for p in ((x, y, z), (y, z, x), (z, x, y))]
    unit = np.array([p / np.linalg.norm(p) for p in points])
    faces = []
    edge = 1.1 * 2.0 / math.sqrt(1.0 + g * g)  # a little more than an edge of the unit icosahedron
    near = np.linalg.norm(unit[:, None] - unit[None], axis=2) < edge
    for i in range(12):
        for j in range(i + 1, 12):
            faces += [(i, j, k) for k in range(j + 1, 12) if near[i, j] and near[j, k] and near[i, k]]
    vertices: list[Floats] = []
    triangles: list[list[int]] = []
    for face in faces:
        a, b, c = (unit[i] for i in face)
        if np.dot(np.cross(b - a, c - a), a) < 0.0:
            b, c = c, b
        ab, bc, ca = ((p + q) / np.linalg.norm(p + q) for p, q in ((a, b), (b, c), (c, a)))
        for triangle in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)):
            triangles.append([len(vertices), len(vertices) + 1, len(vertices) + 2])
            vertices.extend(triangle)
    return Mesh(np.array(vertices) * radius_m, np.array(triangles))
