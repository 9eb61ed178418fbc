"""Register a scan against a surface: point-to-plane ICP that also listens to the given pose, and whether to believe it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONVERGED_M = 5e-4
TREE_LEAF = 24
NEIGHBOURS = 20


@dataclass(frozen=True)
class RegistrationSettings:
    """How to register, and when to believe it.

    Points pair up to ``max_pair_m``; residuals beyond ``kernel_m`` count less (Cauchy). The given pose is known to ``pose_sigma_m`` and
    ``pose_sigma_rad``; all pairs of a scan together count as ``effective_points`` independent ones of ``point_sigma_m``, for neighbours
    share their errors. So a direction that the surfaces do not hold, as along a bare wall, stays as the pose says, and the map follows a
    pose that is right on average (GNSS) instead of carrying its first error along. A result is refused when fewer than ``min_fitness`` of
    the points found a partner or the correction is beyond ``max_correction_m`` or ``max_correction_rad``.
    """

    max_pair_m: float = 0.25
    kernel_m: float = 0.05
    iterations: int = 8
    min_points: int = 100
    min_fitness: float = 0.3
    max_correction_m: float = 0.3
    max_correction_rad: float = 0.05
    pose_sigma_m: float = 0.05
    pose_sigma_rad: float = 0.01
    point_sigma_m: float = 0.05
    effective_points: float = 10.0


@dataclass(frozen=True)
class Registration:
    """What came out: the correction in the map frame, and whether (and if not, why not) to believe it."""

    T_corrected_given: NDArray[np.float64]
    fitness: float
    correction_m: float
    correction_rad: float
    refusal: str

    @property
    def believed(self) -> bool:
        """Whether the correction may be applied."""
        return not self.refusal


class Surface:
    """The flat parts of a cloud (N, 3), metres, with their normals, to register against; making one is costly, asking it is cheap.

    Edges, twigs and the rims of what was seen so far have no plane: a scan that sees farther than the map would be pulled back by them.
    A part is flat when its neighbourhood is thinner than ``flat_m`` (standard deviation) and at least twice as wide.
    """

    def __init__(self, points: NDArray[np.float64], *, normal_radius_m: float, flat_m: float) -> None:
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        cloud.estimate_covariances(o3d.geometry.KDTreeSearchParamHybrid(radius=normal_radius_m, max_nn=NEIGHBOURS))
        spread, axes = np.linalg.eigh(np.asarray(cloud.covariances))
        flat = (spread[:, 0] < flat_m**2) & (spread[:, 1] > 4.0 * flat_m**2)
        self.points = points[flat]
        self.normals: NDArray[np.float64] = axes[flat, :, 0]
        self.tree = cKDTree(self.points, leafsize=TREE_LEAF, balanced_tree=False, compact_nodes=False)


def register(points: NDArray[np.float64], around: NDArray[np.float64], surface: Surface, settings: RegistrationSettings) -> Registration:
    """Find the small motion that lays the points (N, 3), already in the map as the given pose says, onto the surface.

    ``around`` (3,) is the vehicle's position: there the correction is measured, for a rotation about a far origin would look like a shift.
    """
    if len(points) < settings.min_points:
        return Registration(np.eye(4), 0.0, 0.0, 0.0, f"{len(points)} points are too few")
    arms = points - around
    rotation: NDArray[np.float64] = np.eye(3)
    shift: NDArray[np.float64] = np.zeros(3)
    fitness = 0.0
    for _ in range(settings.iterations):
        moved = arms @ rotation.T + shift
        distance, partner = surface.tree.query(moved + around, distance_upper_bound=settings.max_pair_m)
        paired = np.isfinite(distance)
        fitness = float(paired.mean())
        if fitness < settings.min_fitness:
            break
        normals = surface.normals[partner[paired]]
        residual = np.einsum("ij,ij->i", normals, moved[paired] + around - surface.points[partner[paired]])
        step = _step(moved[paired] - shift, normals, residual, (rotation, shift), settings)
        rotation = Rotation.from_rotvec(step[:3]).as_matrix() @ rotation
        shift = shift + step[3:]
        if np.abs(step[3:]).max() < CONVERGED_M and np.abs(step[:3]).max() * settings.max_pair_m < CONVERGED_M:
            break
    return _result(rotation, shift, around, fitness, settings)


def _step(
    arms: NDArray[np.float64],
    normals: NDArray[np.float64],
    residual: NDArray[np.float64],
    at: tuple[NDArray[np.float64], NDArray[np.float64]],
    settings: RegistrationSettings,
) -> NDArray[np.float64]:
    """Return the Gauss-Newton step (6,): rotation vector and shift that reduce residuals and the distance to the given pose."""
    rows = np.hstack([np.cross(arms, normals), normals])
    weight = 1.0 / (1.0 + (residual / settings.kernel_m) ** 2)
    weight *= settings.effective_points / (len(weight) * settings.point_sigma_m**2)
    prior = np.repeat([settings.pose_sigma_rad**-2, settings.pose_sigma_m**-2], 3)
    so_far = np.concatenate([Rotation.from_matrix(at[0]).as_rotvec(), at[1]])
    information = (rows * weight[:, None]).T @ rows + np.diag(prior)
    step: NDArray[np.float64] = -np.linalg.solve(information, rows.T @ (weight * residual) + prior * so_far)
    return step


def _result(
    rotation: NDArray[np.float64], shift: NDArray[np.float64], around: NDArray[np.float64], fitness: float, settings: RegistrationSettings
) -> Registration:
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = around + shift - rotation @ around
    correction_m = float(np.linalg.norm(shift))
    correction_rad = float(Rotation.from_matrix(rotation).magnitude())
    return Registration(transform, fitness, correction_m, correction_rad, _refusal(fitness, correction_m, correction_rad, settings))


def _refusal(fitness: float, correction_m: float, correction_rad: float, settings: RegistrationSettings) -> str:
    if fitness < settings.min_fitness:
        return f"fitness {fitness:.2f} is below {settings.min_fitness:g}"
    if correction_m > settings.max_correction_m:
        return f"correction of {correction_m:.2f} m is beyond {settings.max_correction_m:g} m"
    if correction_rad > settings.max_correction_rad:
        return f"correction of {correction_rad:.3f} rad is beyond {settings.max_correction_rad:g} rad"
    return ""
