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
    """Return a patch for each of the points (N, 3) whose neighbourhood in ``around`` (M, 3) is flat at one of the scales.

    ``around`` has to be thinned to about a third of the smallest radius: a neighbourhood is of a fixed number of points at most.
    """
    tree = cKDTree(around, leafsize=TREE_LEAF, balanced_tree=False, compact_nodes=False)
    found: list[Patches] = []
    left = points
    for scale in scales:
        if not len(left):
            break
        means, normals, flat, crowded = _planes(left, around, tree, scale)
        found.append(Patches(means[flat], normals[flat]))
        # What has many neighbours and is not flat is an edge; only what was too sparse gets another chance, at a larger scale.
        left = left[~crowded]
    return join(found)


def join(parts: Sequence[Patches]) -> Patches:
    """Return all patches as one."""
    if not parts:
        return Patches(np.empty((0, 3)), np.empty((0, 3)))
    return Patches(np.vstack([part.points for part in parts]), np.vstack([part.normals for part in parts]))


def _planes(points: Floats, around: Floats, tree: cKDTree, scale: Scale) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the mean and the normal of each neighbourhood, which are flat, and which had neighbours enough to tell."""
    distance, index = tree.query(points, k=NEIGHBOURS, distance_upper_bound=scale.radius_m)
    near = np.isfinite(distance)
    count = near.sum(axis=1)
    members = np.where(near[:, :, None], around[np.minimum(index, len(around) - 1)], 0.0)
    means = members.sum(axis=1) / np.maximum(count, 1)[:, None]
    offsets = np.where(near[:, :, None], members - means[:, None], 0.0)
    covariances = np.einsum("nki,nkj->nij", offsets, offsets) / np.maximum(count, 1)[:, None, None]
    spread, axes = np.linalg.eigh(covariances)
    crowded = count >= MIN_NEIGHBOURS
    wide = spread[:, 1] > (0.25 * scale.radius_m) ** 2
    return means, axes[:, :, 0], crowded & wide & (spread[:, 0] < scale.flat_m**2), crowded & wide


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
