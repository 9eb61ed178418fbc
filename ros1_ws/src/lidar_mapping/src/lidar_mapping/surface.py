"""The flat patches of a cloud, which scans are registered against.

Only what is flat at the scale at which it was seen is taken: edges, twigs and the rims of what was seen so far have no plane,
and would hold a scan back that sees farther than the map. The smallest scale comes first, because narrow faces (a pilaster's side)
are often all that tells of the motion along a facade.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

PATCH_M = 0.12
"""Apart as clouds are to be thinned for patches: on a plane 14 points are then within the smallest radius."""
NEIGHBOURS = 20
MIN_NEIGHBOURS = 8
TREE_LEAF = 24


@dataclass(frozen=True)
class Scale:
    """A neighbourhood's radius, and the standard deviation across a plane up to which it is flat; metres."""

    radius_m: float
    flat_m: float


SCALES = (Scale(0.25, 0.025), Scale(0.6, 0.04), Scale(1.5, 0.08))


@dataclass(frozen=True)
class Patches:
    """``points`` and unit ``normals``, both (N, 3)."""

    points: Floats
    normals: Floats

    def moved(self, transform: Floats) -> Patches:
        """Return the patches in another frame; ``transform`` (4, 4) is T_other_this."""
        rotation = transform[:3, :3]
        return Patches(self.points @ rotation.T + transform[:3, 3], self.normals @ rotation.T)


def flat_patches(points: Floats, around: Floats, scales: Sequence[Scale] = SCALES) -> Patches:
    """Return a patch for each of the points (N, 3) whose neighbourhood in ``around`` (M, 3) is flat at one of the scales, smallest first.

    ``around`` has to be thinned to `PATCH_M`: a neighbourhood is of a fixed number of points, and in a denser cloud these are too near
    to one another to tell a normal.
    """
    tree = cKDTree(around, leafsize=TREE_LEAF, balanced_tree=False, compact_nodes=False)
    distance, index = tree.query(points, k=NEIGHBOURS, distance_upper_bound=scales[-1].radius_m)
    offsets = around[np.minimum(index, len(around) - 1)] - points[:, None]
    found: list[Patches] = []
    left = np.arange(len(points))
    for scale in scales:
        near = distance[left] < scale.radius_m
        enough = np.count_nonzero(near, axis=1) >= MIN_NEIGHBOURS
        chosen = left[enough]
        means, spread, normals = _planes(offsets[chosen], near[enough])
        wide = spread[:, 1] > (0.25 * scale.radius_m) ** 2
        flat = wide & (spread[:, 0] < scale.flat_m**2)
        found.append(Patches(points[chosen[flat]] + means[flat], normals[flat]))
        # What has many neighbours and is not flat is an edge; only what was too sparse gets another chance, at a larger scale.
        left = np.setdiff1d(left, chosen[wide], assume_unique=True)
    return join(found)


def join(parts: Sequence[Patches]) -> Patches:
    """Return all patches as one."""
    if not parts:
        return Patches(np.empty((0, 3)), np.empty((0, 3)))
    return Patches(np.vstack([part.points for part in parts]), np.vstack([part.normals for part in parts]))


def _planes(offsets: Floats, near: NDArray[np.bool_]) -> tuple[Floats, Floats, Floats]:
    """Return mean (N, 3), variances along the axes (N, 2; the smallest two) and normal (N, 3) of offsets (N, K, 3) where they are near."""
    count = np.count_nonzero(near, axis=1)[:, None]
    means = np.einsum("nk,nki->ni", near, offsets) / count
    centred = (offsets - means[:, None]) * near[:, :, None]
    spread, normals = smallest_axis(np.matmul(centred.transpose(0, 2, 1), centred) / count[:, :, None])
    return means, spread, normals


def smallest_axis(symmetric: Floats) -> tuple[Floats, Floats]:
    """Return the smaller two eigenvalues (N, 2) of symmetric matrices (N, 3, 3), and the unit eigenvectors (N, 3) of the smallest.

    In closed form (Smith 1961): ten times as fast for small matrices as the general way. Where two eigenvalues agree the vector is any.
    """
    mean = np.trace(symmetric, axis1=1, axis2=2) / 3.0
    rest = symmetric - mean[:, None, None] * np.eye(3)
    size = np.maximum(np.sqrt(np.einsum("nij,nij->n", rest, rest) / 6.0), np.finfo(float).tiny ** 0.25)
    angle = np.arccos(np.clip(np.linalg.det(rest) / (2.0 * size**3), -1.0, 1.0)) / 3.0
    least = mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    middle = 3.0 * mean - least - (mean + 2.0 * size * np.cos(angle))
    rows = symmetric - least[:, None, None] * np.eye(3)
    normals = np.cross(rows, np.roll(rows, -1, axis=1))  # the vector is square to all rows
    length = np.linalg.norm(normals, axis=2)
    best = np.argmax(length, axis=1)
    chosen = np.arange(len(best))
    return np.stack([least, middle], axis=1), normals[chosen, best] / np.maximum(length[chosen, best], np.finfo(float).tiny)[:, None]


class Surface:
    """Patches to register against; making one builds a search tree, asking it is cheap."""

    def __init__(self, patches: Patches) -> None:
        self.points, self.normals = patches.points, patches.normals
        self._tree = cKDTree(self.points, leafsize=TREE_LEAF, balanced_tree=False, compact_nodes=False)

    def nearest(self, points: Floats, *, within_m: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of the points (N, 3) have a patch within reach, and the index of that patch."""
        distance, index = self._tree.query(points, distance_upper_bound=within_m)
        paired = np.flatnonzero(np.isfinite(distance))
        return paired, index[paired]
