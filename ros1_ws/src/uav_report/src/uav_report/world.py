"""The world's true surfaces: a triangle mesh in the frame map, metres, that can be asked for distances and sight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alula.common.open3d_core import o3d
from alula.report.files import ReportError

Floats = NDArray[np.float64]
SHARP_EDGE_DEG = 25.0


class TrueSurfaces:
    """``vertices`` (V, 3) float64 and ``triangles`` (T, 3) int64."""

    def __init__(self, vertices: Floats, triangles: NDArray[np.int64]) -> None:
        self.vertices = vertices
        self.triangles = triangles
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(_tensor(vertices), o3d.core.Tensor(triangles.astype(np.uint32)))

    @classmethod
    def load(cls, path: Path) -> TrueSurfaces:
        """Read a mesh; raise ReportError when it is missing, cut off or without triangles."""
        if not path.exists():
            raise ReportError(f"{path.name} is missing: distances to the true surfaces can't be computed")
        with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
            mesh = o3d.io.read_triangle_mesh(str(path))
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        triangles = np.asarray(mesh.triangles, dtype=np.int64)
        if not len(triangles) or triangles.max() >= len(vertices) or not np.isfinite(vertices).all():
            raise ReportError(f"{path.name} holds no usable mesh")
        return cls(vertices, triangles)

    def nearest(self, points: Floats) -> Floats:
        """Return the point of the surfaces that is nearest to each of ``points``, both (N, 3)."""
        return np.asarray(self._scene.compute_closest_points(_tensor(points))["points"].numpy(), dtype=np.float64)

    def distance_m(self, points: Floats) -> Floats:
        """Return the distance of each of ``points`` (N, 3) to the nearest surface, (N,)."""
        return np.asarray(self._scene.compute_distance(_tensor(points)).numpy(), dtype=np.float64)

    def first_hit_m(self, origin: Floats, directions: Floats) -> Floats:
        """Return how far from ``origin`` (3,) rays along unit ``directions`` (N, 3) go before they hit; +inf for never."""
        rays = np.concatenate([np.broadcast_to(origin, directions.shape), directions], axis=1)
        return np.asarray(self._scene.cast_rays(_tensor(rays))["t_hit"].numpy(), dtype=np.float64)

    def sample(self, spacing_m: float, seed: int) -> tuple[Floats, Floats]:
        """Spread points evenly over the surfaces, one per square of ``spacing_m``; return points and unit normals, (N, 3) each.

        Triangles are drawn by systematic sampling along the cumulated area, so that equal areas get equal numbers to within
        one; places in a triangle are uniform (Osada et al. 2002, equation 1).
        """
        random = np.random.default_rng(seed)
        a, b, c = (self.vertices[self.triangles[:, corner]] for corner in range(3))
        normal = np.cross(b - a, c - a)
        double_area = np.linalg.norm(normal, axis=1)
        cumulated = np.cumsum(double_area / 2) / spacing_m**2
        count = int(cumulated[-1])
        chosen = np.searchsorted(cumulated, np.arange(count) + random.random(), side="right").clip(max=len(a) - 1)
        root, second = np.sqrt(random.random((count, 1))), random.random((count, 1))
        points = (1 - root) * a[chosen] + root * (1 - second) * b[chosen] + root * second * c[chosen]
        return points, normal[chosen] / double_area[chosen, None]

    def outline(self) -> Floats:
        """Return the edges where the surface ends or bends, (E, 2, 3): what a draughtsman would draw."""
        # Corners in one place are one corner: boxes and planes are usually written with vertices of their own.
        _, corner = np.unique(self.vertices.round(4), axis=0, return_inverse=True)
        triangles = corner.reshape(-1)[self.triangles]
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        face = np.tile(np.arange(len(triangles)), 3)
        place = np.concatenate([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])
        _, first, group, faces = np.unique(edges, axis=0, return_index=True, return_inverse=True, return_counts=True)
        total = np.zeros((len(first), 3))
        np.add.at(total, group.reshape(-1), normal[face])
        # Two faces at an angle A have normals whose sum is 2 cos(A / 2) long.
        bends = np.linalg.norm(total, axis=1) < 2 * np.cos(np.radians(SHARP_EDGE_DEG) / 2)
        return np.asarray(self.vertices[place[first[(faces != 2) | bends]]], dtype=np.float64)


def _tensor(values: Floats) -> Any:
    return o3d.core.Tensor(np.ascontiguousarray(values, dtype=np.float32))
