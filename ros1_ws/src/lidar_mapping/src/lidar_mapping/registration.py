"""Register a scan against a surface from a predicted state, and say whether to believe it.

Point to plane, with a gate that narrows. Where the surfaces do not hold a direction (along a bare wall) the normals' own noise still looks
like information; what it would amount to is taken off, so that such a direction stays as the inertial prediction has it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.inertial import ATTITUDE, POSITION, TERMS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidar_mapping.inertial import InertialFilter, State
    from lidar_mapping.surface import Surface

    Floats = NDArray[np.float64]

POSE = np.array([0, 1, 2, 6, 7, 8])
"""The places of attitude and position in the filter's error."""


@dataclass(frozen=True)
class RegistrationSettings:
    """How to register, and when to believe it.

    Pairs are searched within a gate that shrinks from three standard deviations of the prediction (at least ``widest_m / 5``, at most
    ``widest_m``) to ``gate_m``; residuals beyond ``kernel_m`` count less (Cauchy). A point is known to ``point_sigma_m``, and neighbours
    share their errors, as do the sweeps that meet the same patches: ``independent`` of them count. ``tilt_rad`` is the noise of a normal.

    A result is refused when fewer than ``min_points``, or fewer than ``min_fitness`` of those that have a patch within three gates, lie
    within half a gate of its plane: what sees new ground is not to blame for having no partner there, and of points laid down at
    random a sixth would lie so.
    """

    widest_m: float = 2.0
    gate_m: float = 0.12
    kernel_m: float = 0.05
    gates: int = 6
    iterations: int = 12
    min_points: int = 80
    min_fitness: float = 0.5
    point_sigma_m: float = 0.02
    independent: float = 0.1
    tilt_rad: float = 0.06
    constrained_m: float = 0.2


@dataclass(frozen=True)
class Registration:
    """What came out: ``fitness`` 0..1, the correction of the prediction, the directions that no surface holds, and why not to believe it.

    ``sigma_m`` (3,) are the standard deviations of the scan's own measurement along ``directions`` (3, 3; columns, map frame), best last.
    """

    fitness: float
    correction_m: float
    sigma_m: Floats
    directions: Floats
    refusal: str
    limit_m: float = 0.2

    @property
    def believed(self) -> bool:
        """Whether it was taken."""
        return not self.refusal

    @property
    def degenerate(self) -> int:
        """In how many directions of space the surfaces did not hold the scan."""
        return int(np.count_nonzero(self.sigma_m > self.limit_m))


def refused(reason: str, fitness: float = 0.0) -> Registration:
    """Return the registration of a scan that was not taken."""
    return Registration(fitness, 0.0, np.full(3, np.inf), np.eye(3), reason)


class _Measurement:
    """The normal equations of the pairs of points (N, 3), body frame, with a surface; each call narrows the gate."""

    def __init__(self, points: Floats, surface: Surface, settings: RegistrationSettings, first_gate_m: float) -> None:
        self._points, self._surface, self._settings = points, surface, settings
        narrowing = np.geomspace(first_gate_m, settings.gate_m, settings.gates)
        self._gates_m = itertools.chain(narrowing, itertools.repeat(settings.gate_m))
        self.pairs = 0
        self.fitness = 0.0
        self.held: Floats = np.zeros((3, 3))

    def __call__(self, state: State) -> tuple[Floats, Floats]:
        gate_m = next(self._gates_m)
        settings = self._settings
        placed = self._points @ state.rotation.T + state.position
        paired, partner = self._surface.nearest(placed, within_m=gate_m)
        normals = self._surface.normals[partner]
        residual = np.einsum("ij,ij->i", normals, placed[paired] - self._surface.points[partner])
        kernel_m = max(0.2 * gate_m, settings.kernel_m)
        weight = settings.independent / settings.point_sigma_m**2 / (1.0 + (residual / kernel_m) ** 2)
        rows = np.hstack([np.cross(self._points[paired], normals @ state.rotation), normals])
        return self._spread((rows * weight[:, None]).T @ rows, rows.T @ (weight * residual), float(weight.sum()))

    def judge(self, state: State) -> None:
        """Find out how well the points lie where the state puts them."""
        placed = self._points @ state.rotation.T + state.position
        near, partner = self._surface.nearest(placed, within_m=3.0 * self._settings.gate_m)
        off_m = np.abs(np.einsum("ij,ij->i", self._surface.normals[partner], placed[near] - self._surface.points[partner]))
        self.pairs = int(np.count_nonzero(off_m < 0.5 * self._settings.gate_m))
        self.fitness = self.pairs / max(len(near), 1)

    def _spread(self, information: Floats, gradient: Floats, total: float) -> tuple[Floats, Floats]:
        """Take the information of noise off, and put the rest in the filter's places."""
        values, axes = np.linalg.eigh(information[3:, 3:])
        noise = 3.0 * self._settings.tilt_rad**2 * total
        share = np.clip((values - noise) / np.maximum(values, 1e-9), 0.0, 1.0)
        scale = np.eye(6)
        scale[3:, 3:] = axes @ np.diag(np.sqrt(share)) @ axes.T
        information, gradient = scale @ information @ scale, scale @ gradient
        self.held = information[3:, 3:]
        whole, whole_gradient = np.zeros((TERMS, TERMS)), np.zeros(TERMS)
        whole[np.ix_(POSE, POSE)], whole_gradient[POSE] = information, gradient
        return whole, whole_gradient


def register(points: Floats, surface: Surface, state: InertialFilter, settings: RegistrationSettings) -> Registration:
    """Correct the filter by a scan (N, 3), body frame, straightened; a scan that is refused leaves the filter as it was predicted."""
    if len(points) < settings.min_points:
        return refused(f"{len(points)} points are too few")
    predicted, take_back = state.state, state.keep()
    covariance = state.covariance
    doubt_m = 3.0 * float(np.sqrt(np.linalg.eigvalsh(covariance[POSITION, POSITION])[-1]))
    reach_m = 3.0 * float(np.sqrt(np.linalg.eigvalsh(covariance[ATTITUDE, ATTITUDE])[-1])) * 5.0  # at 5 m
    first_gate_m = float(np.clip(doubt_m + reach_m, settings.widest_m / 5.0, settings.widest_m))
    measurement = _Measurement(points, surface, settings, first_gate_m)
    state.correct(measurement, least=settings.gates, most=settings.iterations)
    measurement.judge(state.state)
    reason = _reason(measurement, settings)
    if reason:
        take_back()
        return refused(reason, measurement.fitness)
    values, axes = np.linalg.eigh(measurement.held)
    correction_m = float(np.linalg.norm(state.state.position - predicted.position))
    return Registration(measurement.fitness, correction_m, np.maximum(values, 1e-6) ** -0.5, axes, "", settings.constrained_m)


def _reason(measurement: _Measurement, settings: RegistrationSettings) -> str:
    if measurement.pairs < settings.min_points:
        return f"{measurement.pairs} points found a surface, {settings.min_points} are needed"
    if measurement.fitness < settings.min_fitness:
        return f"fitness {measurement.fitness:.2f} is below {settings.min_fitness:g}"
    return ""
