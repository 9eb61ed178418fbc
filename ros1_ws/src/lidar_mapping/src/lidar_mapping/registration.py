"""Register a scan against a surface: point-to-plane ICP (open3d), and whether its result is to be believed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import open3d as o3d
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class RegistrationSettings:
    """How to register, and when to believe it.

    ``max_pair_m`` pairs points, ``kernel_m`` weighs down pairs farther apart (Tukey). A correction is believed when at least
    ``min_fitness`` of the points found a partner, it is at most ``max_correction_m`` and ``max_correction_rad``, and the surfaces hold all
    six degrees of freedom: ``min_condition`` is the smallest over the largest eigenvalue of the normal equations, lengths scaled by the
    scan's size.
    """

    max_pair_m: float = 0.4
    kernel_m: float = 0.15
    iterations: int = 12
    min_points: int = 100
    min_fitness: float = 0.6
    max_correction_m: float = 0.3
    max_correction_rad: float = 0.05
    min_condition: float = 0.005


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
    """Points with normals to register against, (N, 3), metres."""

    def __init__(self, points: NDArray[np.float64], *, normal_radius_m: float) -> None:
        self.cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        self.cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=normal_radius_m, max_nn=20))
        self.normals: NDArray[np.float64] = np.asarray(self.cloud.normals)


def register(points: NDArray[np.float64], around: NDArray[np.float64], surface: Surface, settings: RegistrationSettings) -> Registration:
    """Find the small motion that lays the points (N, 3), already in the map as the given pose says, onto the surface.

    ``around`` (3,) is the vehicle's position: there the correction is measured, for a rotation about a far origin would look like a shift.
    """
    if len(points) < settings.min_points:
        return Registration(np.eye(4), 0.0, 0.0, 0.0, f"{len(points)} points are too few")
    source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points - around))
    target = o3d.geometry.PointCloud(surface.cloud).translate(-around)
    result = o3d.pipelines.registration.registration_icp(
        source,
        target,
        settings.max_pair_m,
        np.eye(4),
        o3d.pipelines.registration.TransformationEstimationPointToPlane(o3d.pipelines.registration.TukeyLoss(k=settings.kernel_m)),
        o3d.pipelines.registration.ICPConvergenceCriteria(1e-5, 1e-5, settings.iterations),
    )
    local = np.asarray(result.transformation)
    pairs = np.asarray(result.correspondence_set)
    condition = _condition(np.asarray(source.points)[pairs[:, 0]], surface.normals[pairs[:, 1]]) if len(pairs) else 0.0
    correction_m = float(np.linalg.norm(local[:3, 3]))
    correction_rad = float(Rotation.from_matrix(local[:3, :3]).magnitude())
    refusal = _refusal(float(result.fitness), correction_m, correction_rad, condition, settings)
    shift = np.eye(4)
    shift[:3, 3] = around
    return Registration(shift @ local @ np.linalg.inv(shift), float(result.fitness), correction_m, correction_rad, refusal)


def _condition(points: NDArray[np.float64], normals: NDArray[np.float64]) -> float:
    """Return how well the pairs hold the pose, 0 (it slides) to 1; the rotations' arms are scaled to the scan's mean radius."""
    radius = max(float(np.sqrt(np.mean(np.sum(points**2, axis=1)))), 1e-6)
    rows = np.hstack([np.cross(points / radius, normals), normals])
    eigenvalues = np.linalg.eigvalsh(rows.T @ rows)
    return float(max(eigenvalues[0], 0.0) / eigenvalues[-1])


def _refusal(fitness: float, correction_m: float, correction_rad: float, condition: float, settings: RegistrationSettings) -> str:
    if fitness < settings.min_fitness:
        return f"fitness {fitness:.2f} is below {settings.min_fitness:g}"
    if correction_m > settings.max_correction_m:
        return f"correction of {correction_m:.2f} m is beyond {settings.max_correction_m:g} m"
    if correction_rad > settings.max_correction_rad:
        return f"correction of {correction_rad:.3f} rad is beyond {settings.max_correction_rad:g} rad"
    if condition < settings.min_condition:
        return f"the surfaces do not hold the pose: condition {condition:.4f} is below {settings.min_condition:g}"
    return ""
