"""The flat patches of a cloud, which scans are registered against.

Only what is flat at the scale at which it was seen is taken: edges, twigs and the rims of what was seen so far have no plane,
and would hold a scan back that sees farther than the map. The smallest scale comes first, because narrow faces (a pilaster's side)
are often all that tells of the motion along a facade.
"""

from __future__ import annotations

import itertools
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
BLOCK = 2048  # points whose neighbourhoods are looked at together: 10 MB less for a keyframe of 64 beams than all at once
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
    tree = _tree(around)
    columns = np.vstack([around, np.zeros((1, 3))]).T.copy()  # the tree's index of a neighbour that is missing is the one after the last
    found: list[Patches] = []
    for scale in scales:
        rest: list[Floats] = [points[:0]]
        for begin in range(0, len(points), BLOCK):
            flat, other = _flat(points[begin : begin + BLOCK], columns, tree, scale)
            found.append(flat)
            rest.append(other)
        points = np.vstack(rest)
    return join(found)


def _flat(points: Floats, columns: Floats, tree: cKDTree, scale: Scale) -> tuple[Patches, Floats]:
    """Return the patches of the points (N, 3) whose neighbourhood among ``columns`` (3, M + 1) is flat, and the points of another scale."""
    _, index = tree.query(points, k=NEIGHBOURS, distance_upper_bound=scale.radius_m)
    near = index < tree.n
    count = np.count_nonzero(near, axis=1)
    enough = count >= MIN_NEIGHBOURS
    sparse, points, index, near = points[~enough], points[enough], index[enough], near[enough]
    offsets = np.stack([(axis.take(index) - centre[:, None]) * near for axis, centre in zip(columns, points.T, strict=True)])
    means, spread, normals = _planes(offsets, count[enough])
    wide = spread[:, 1] > (0.25 * scale.radius_m) ** 2
    flat = wide & (spread[:, 0] < scale.flat_m**2)
    # What has many neighbours and is not flat is an edge; only what was too sparse gets another chance, at a larger scale.
    return Patches(points[flat] + means[flat], normals[flat]), np.vstack([sparse, points[~wide]])


def join(parts: Sequence[Patches]) -> Patches:
    """Return all patches as one."""
    if not parts:
        return Patches(np.empty((0, 3)), np.empty((0, 3)))
    return Patches(np.vstack([part.points for part in parts]), np.vstack([part.normals for part in parts]))


def _planes(offsets: Floats, count: NDArray[np.intp]) -> tuple[Floats, Floats, Floats]:
    """Return mean (N, 3), variances along the axes (N, 2; the smallest two) and normal (N, 3) of offsets (3, N, K).

    Only ``count`` (N,) of the K offsets count; the others are zero.
    """
    means = offsets.sum(axis=2) / count
    moments = np.empty((len(count), 3, 3))
    for i, j in itertools.combinations_with_replacement(range(3), 2):
        moments[:, i, j] = moments[:, j, i] = np.einsum("nk,nk->n", offsets[i], offsets[j]) / count - means[i] * means[j]
    spread, normals = smallest_axis(moments)
    return means.T, spread, normals


def smallest_axis(symmetric: Floats) -> tuple[Floats, Floats]:
    """Return the smaller two eigenvalues (N, 2) of symmetric matrices (N, 3, 3), and the unit eigenvectors (N, 3) of the smallest.

    In closed form (Smith 1961): ten times as fast for small matrices as the general way. Where two eigenvalues agree the vector is any.
    """
    matrix = np.ascontiguousarray(symmetric.transpose(1, 2, 0))
    mean = np.einsum("iin->n", matrix) / 3.0
    rest = matrix - mean * np.eye(3)[:, :, None]
    size = np.maximum(np.sqrt(np.einsum("ijn,ijn->n", rest, rest) / 6.0), np.finfo(float).tiny ** 0.25)
    determinant = np.einsum("in,in->n", rest[0], cross(rest[1], rest[2]))
    angle = np.arccos(np.clip(determinant / (2.0 * size**3), -1.0, 1.0)) / 3.0
    least = mean + 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    middle = 3.0 * mean - least - (mean + 2.0 * size * np.cos(angle))
    rows = matrix - least * np.eye(3)[:, :, None]
    normals = np.stack([cross(rows[i], rows[i - 1]) for i in range(3)])  # the vector is square to all rows
    squared = np.einsum("kin,kin->kn", normals, normals)
    best, chosen = np.argmax(squared, axis=0), np.arange(len(least))
    length = np.sqrt(np.maximum(squared[best, chosen], np.finfo(float).tiny))
    return np.stack([least, middle], axis=1), normals[best, :, chosen] / length[:, None]


def cross(a: Floats, b: Floats, out: Floats | None = None) -> Floats:
    """Return the cross products of columns (3, N), in ``out`` if it is given; several times as fast as `numpy.cross` of rows."""
    product = np.empty_like(a) if out is None else out
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=product[i])
        product[i] -= a[k] * b[j]
    return product


class Surface:
    """Patches to register against: ``points`` and ``normals`` (N, 3). Making one builds a search tree, asking it is cheap."""

    def __init__(self, patches: Patches, trees: Sequence[tuple[int, cKDTree]] = ()) -> None:
        self.points, self.normals = patches.points, patches.normals
        self._trees = trees or [(0, _tree(self.points))]  # with the number of the first patch in each

    def joined(self, patches: Patches) -> Surface:
        """Return this surface with more patches, in a second tree with those joined before: building one of all patches takes long."""
        whole, grown = self._trees[0], join([Patches(self.points, self.normals), patches])
        first = whole[1].n
        return Surface(grown, [whole, (first, _tree(grown.points[first:]))])

    def nearest(self, points: Floats, *, within_m: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of the points (N, 3) have a patch within reach, and the index of that patch."""
        distance, index = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.intp)
        for first, tree in self._trees:
            away, found = tree.query(points, distance_upper_bound=within_m)
            nearer = away < distance
            distance[nearer], index[nearer] = away[nearer], first + found[nearer]
        paired = np.flatnonzero(np.isfinite(distance))
        return paired, index[paired]


def _tree(points: Floats) -> cKDTree:
    return cKDTree(points, leafsize=TREE_LEAF, balanced_tree=False, compact_nodes=False)
