"""Register a scan against a surface from a predicted state, and judge whether the result is plausible.

Point to plane, with a gate that narrows. Where the surfaces do not hold a direction (along a bare wall) the normals' own noise still looks
like information; what it would amount to is taken off, so that such a direction stays as the inertial prediction has it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.inertial import ATTITUDE, POSITION, TERMS
from lidar_mapping.surface import cross

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidar_mapping.inertial import InertialFilter, InertialState
    from lidar_mapping.surface import Surface

    Floats = NDArray[np.float64]

SEARCHED_M = 0.03  # patches are searched again where a point has moved by more: within that a neighbouring patch tells of the same plane
FITNESS_GATES = 3.0


@dataclass(frozen=True)
class RegistrationSettings:
    """How to register, and which results to accept.

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
    """The result: ``fitness`` 0..1, the correction of the prediction, the directions that no surface holds, and the reason of a refusal.

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
        """Whether the scan was registered: there is no reason of refusal."""
        return not self.refusal

    @property
    def degenerate(self) -> int:
        """In how many directions of space the surfaces did not hold the scan."""
        return int(np.count_nonzero(self.sigma_m > self.limit_m))


def refused(reason: str, fitness: float = 0.0) -> Registration:
    """Return the registration of a scan that was not taken."""
    return Registration(fitness, 0.0, np.full(3, np.inf), np.eye(3), reason)


class _Measurement:
    """The normal equations of the pairs of points (N, 3), body frame, with a surface; each call narrows the gate.

    Inside, points are columns (3, N): numpy takes several times as long for rows of three.
    """

    def __init__(self, points: Floats, surface: Surface, settings: RegistrationSettings, first_gate_m: float) -> None:
        self._points, self._surface, self._settings = np.ascontiguousarray(points.T), surface, settings
        narrowing = np.geomspace(first_gate_m, settings.gate_m, settings.gates)
        self._gates_m = itertools.chain(narrowing, itertools.repeat(settings.gate_m))
        self._reach_m = max(first_gate_m, FITNESS_GATES * settings.gate_m)
        self._searched: Floats | None = None
        self.pairs = 0
        self.fitness = 0.0
        self.held: Floats = np.zeros((3, 3))

    def __call__(self, state: InertialState) -> tuple[Floats, Floats]:
        gate_m = next(self._gates_m)
        settings = self._settings
        off_m, inside = self._off(state, gate_m)
        kernel_m = max(0.2 * gate_m, settings.kernel_m)
        weight = inside * (settings.independent / settings.point_sigma_m**2 / (1.0 + (off_m / kernel_m) ** 2))
        rows = self._rows
        cross(self._paired, state.rotation.T @ rows[3:], out=rows[:3])
        return self._spread((rows * weight) @ rows.T, rows @ (weight * off_m), float(weight.sum()))

    def judge(self, state: InertialState) -> None:
        """Find out how well the points lie where the state puts them."""
        off_m, near = self._off(state, FITNESS_GATES * self._settings.gate_m)
        self.pairs = int(np.count_nonzero(near & (np.abs(off_m) < 0.5 * self._settings.gate_m)))
        self.fitness = self.pairs / max(int(np.count_nonzero(near)), 1)

    def _off(self, state: InertialState, gate_m: float) -> tuple[Floats, NDArray[np.bool_]]:
        """Return of each pair how far the point is off the plane of its patch (N,), metres, and whether the patch is within the gate."""
        placed = state.rotation @ self._points + state.position[:, None]
        if self._searched is None or np.abs(placed - self._searched).max() > SEARCHED_M:
            self._searched = placed
            self._chosen, patch = self._surface.nearest(placed.T, within_m=self._reach_m)
            self._paired = self._points.take(self._chosen, axis=1)
            self._patches = np.ascontiguousarray(self._surface.points.take(patch, axis=0).T)
            self._rows = np.empty((6, len(patch)))  # by how much a turn and a shift move each point along its patch's normal
            self._rows[3:] = self._surface.normals.take(patch, axis=0).T
        apart = placed.take(self._chosen, axis=1) - self._patches
        off_m: Floats = np.einsum("ij,ij->j", self._rows[3:], apart)
        return off_m, np.einsum("ij,ij->j", apart, apart) < gate_m**2

    def _spread(self, information: Floats, gradient: Floats, total: float) -> tuple[Floats, Floats]:
        """Take the information of noise off, and put the rest in the filter's places."""
        values, axes = np.linalg.eigh(information[3:, 3:])
        noise = 3.0 * self._settings.tilt_rad**2 * total
        share = np.minimum(np.maximum(values - noise, 0.0) / np.maximum(values, 1e-9), 1.0)
        scale = (axes * np.sqrt(share)) @ axes.T
        self.held = scale @ information[3:, 3:] @ scale
        mixed = information[:3, 3:] @ scale
        whole, whole_gradient = np.zeros((TERMS, TERMS)), np.zeros(TERMS)
        whole[ATTITUDE, ATTITUDE], whole[ATTITUDE, POSITION] = information[:3, :3], mixed
        whole[POSITION, ATTITUDE], whole[POSITION, POSITION] = mixed.T, self.held
        whole_gradient[ATTITUDE], whole_gradient[POSITION] = gradient[:3], scale @ gradient[3:]
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
