"""The pose graph of the keyframes: odometry, loops, and the autopilot's position, optimised when a loop was found (gtsam).

It also says how well the last keyframe is known in the map. The odometry lays each scan onto keyframes that it has placed itself, so
its own covariance is that of the pose relative to them, and says nothing of the error that they hand on from one to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import gtsam
import numpy as np

from lidar_mapping.inertial import POSITION, InertialFilter, InertialNoise, State, cross_matrix
from lidar_mapping.registration import RegistrationSettings, register

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidar_mapping.keyframes import Keyframes

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GraphSettings:
    """When a place is taken for a known one, and what is believed of what; metres, radians.

    A keyframe is held against one that lies at least ``path_m`` of flight back and within ``reach_m``. The drift of the odometry is
    ``drift`` of the way and ``turn_rad`` a keyframe. The autopilot's position is believed to ``autopilot_m``: loosely, for its error is the
    same for minutes, so that many keyframes know no more of it than one.
    """

    path_m: float = 25.0
    reach_m: float = 6.0
    every: int = 3
    drift: float = 0.01
    least_m: float = 0.005
    turn_rad: float = 0.001
    loop_m: float = 0.03
    loop_rad: float = 0.005
    loop_fitness: float = 0.7
    autopilot_m: float = 30.0
    submap: int = 6


class PoseGraph:
    """Adds keyframes one after the other, finds loops, and says how the poses are to be moved."""

    def __init__(self, settings: GraphSettings, registration: RegistrationSettings) -> None:
        self._settings, self._registration = settings, registration
        self._factors = gtsam.NonlinearFactorGraph()
        self._path_m: list[float] = []
        self.loops = 0
        self.covariance: Floats = np.zeros((6, 6))
        """Of the last keyframe's pose: rotation vector and position, map frame (6, 6)."""

    def add(self, keyframes: Keyframes, autopilot_position: Floats | None) -> bool:
        """Take the last keyframe; when it closes a loop, move all keyframes' poses and return True."""
        settings, index = self._settings, len(keyframes.all) - 1
        frame = keyframes.all[index]
        if index == 0:
            self._factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(frame.pose), _noise(1e-3, 1e-3)))
            self._path_m.append(0.0)
            return False
        step = np.linalg.inv(keyframes.all[index - 1].pose) @ frame.pose
        length_m = float(np.linalg.norm(step[:3, 3]))
        odometry = _noise(settings.turn_rad, settings.least_m + settings.drift * length_m)
        self._factors.add(gtsam.BetweenFactorPose3(index - 1, index, gtsam.Pose3(step), odometry))
        self._path_m.append(self._path_m[-1] + length_m)
        self._go_on(frame.pose[:3, 3] - keyframes.all[index - 1].pose[:3, 3], odometry)
        if autopilot_position is not None:
            heard = gtsam.noiseModel.Isotropic.Sigma(3, settings.autopilot_m)
            self._factors.add(gtsam.GPSFactor(index, np.asarray(autopilot_position, dtype=np.float64), heard))
        known = self._known_place(keyframes) if index % settings.every == 0 else None
        return known is not None and self._close(keyframes, known)

    def _go_on(self, moved_m: Floats, odometry: gtsam.noiseModel.Diagonal) -> None:
        """Carry the covariance on by one keyframe: an error of attitude displaces what lies farther on."""
        carried = np.eye(6)
        carried[3:, :3] = -cross_matrix(moved_m)
        self.covariance = carried @ self.covariance @ carried.T + odometry.covariance()

    def _known_place(self, keyframes: Keyframes) -> int | None:
        """Return the nearest keyframe that lies long enough back; None when there is none."""
        settings, here = self._settings, keyframes.all[-1].pose[:3, 3]
        long_ago = [i for i, path_m in enumerate(self._path_m) if self._path_m[-1] - path_m > settings.path_m]
        if not long_ago:
            return None
        away_m = [float(np.linalg.norm(keyframes.all[i].pose[:3, 3] - here)) for i in long_ago]
        nearest = int(np.argmin(away_m))
        return long_ago[nearest] if away_m[nearest] < settings.reach_m else None

    def _close(self, keyframes: Keyframes, known: int) -> bool:
        """Register the last keyframe against what was seen around a known one; optimise when that is believed."""
        settings, index = self._settings, len(keyframes.all) - 1
        frame = keyframes.all[index]
        around = slice(max(0, known - settings.submap), known + settings.submap + 1)
        surface = keyframes.surface(frame.pose[:3, 3], 4.0 * settings.reach_m, among=around)
        if surface is None:
            return False
        rotation, position = frame.pose[:3, :3], frame.pose[:3, 3]
        place = InertialFilter(_loose(), frame.stamp_ns, State(rotation, np.zeros(3), position))
        place.covariance[POSITION, POSITION] = np.eye(3) * 0.3**2
        found = register(frame.patches.points[:: max(1, len(frame.patches.points) // 2000)], surface, place, self._registration)
        if not found.believed or found.fitness < settings.loop_fitness or found.degenerate:
            return False
        relative = np.linalg.inv(keyframes.all[known].pose) @ place.state.matrix
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(1.0), _noise(settings.loop_rad, settings.loop_m))
        self._factors.add(gtsam.BetweenFactorPose3(known, index, gtsam.Pose3(relative), robust))
        self.loops += 1
        return self._optimise(keyframes)

    def _optimise(self, keyframes: Keyframes) -> bool:
        values = gtsam.Values()
        for i, frame in enumerate(keyframes.all):
            values.insert(i, gtsam.Pose3(frame.pose))
        best = gtsam.LevenbergMarquardtOptimizer(self._factors, values).optimize()
        for i, frame in enumerate(keyframes.all):
            frame.pose = best.atPose3(i).matrix()
        last = len(keyframes.all) - 1
        turn = np.kron(np.eye(2), keyframes.all[last].pose[:3, :3])  # gtsam tells of the body's axes
        self.covariance = turn @ gtsam.Marginals(self._factors, best).marginalCovariance(last) @ turn.T
        return True


def _noise(turn_rad: float, shift_m: float) -> gtsam.noiseModel.Diagonal:
    return gtsam.noiseModel.Diagonal.Sigmas(np.repeat([turn_rad, shift_m], 3))


def _loose() -> InertialNoise:
    return InertialNoise(start_attitude_rad=0.05)
