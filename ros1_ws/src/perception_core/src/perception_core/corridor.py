"""The corridor that the vehicle is about to fly through, and what stands nearest in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOVING_M_S = 0.2
PUSHED_M_S = 1.0  # by gusts of a wind of 8 m/s; it stops within its own radius
AT_TARGET_M = 0.3


@dataclass(frozen=True)
class Corridor:
    """A box from the vehicle's centre along its motion; metres.

    Half width: the vehicle's radius with propellers (0.85 m) and a margin of 0.4 m. What is lower than ``floor_m`` above the map's ground
    is ground. Obstacles are counted only beyond ``near_m`` from the centre: nearer is the vehicle itself.
    """

    half_width_m: float = 1.25
    half_height_m: float = 0.6
    length_m: float = 8.0
    near_m: float = 0.3
    floor_m: float = 0.2

    def surrounds(self, seen: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which points (N, 3: metres ahead, left, above) are in the corridor, or in the ground that it cuts."""
        inside: NDArray[np.bool_] = (
            (np.abs(seen[:, 1]) <= self.half_width_m)
            & (np.abs(seen[:, 2]) <= self.half_height_m)
            & (seen[:, 0] >= self.near_m)
            & (seen[:, 0] <= self.length_m)
        )
        return inside

    def contains(self, seen: NDArray[np.float64], height_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (N, 3: metres ahead, left, above; and their height over the ground, (N,)) are in the corridor."""
        return self.surrounds(seen) & (height_m >= self.floor_m)


@dataclass(frozen=True)
class VehicleMotion:
    """The motion by the guidance: velocity (m/s, ENU) and the target (metres, ENU) when it follows a position reference."""

    velocity_enu_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target_enu_m: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Support:
    """How much must be seen in one place to count as an obstacle.

    The corridor is cut into cells of ``cell_m``; along it they grow as ``range_error_per_m * distance**2`` where that is longer (stereo).
    Two by two by two neighbouring cells must together hold ``min_points`` points and ``min_area_m2`` of seen surface; of a dense sensor
    also ``points_at_1_m`` points, by the square of the distance fewer.
    """

    min_points: int = 3
    min_area_m2: float = 0.0
    cell_m: float = 0.25
    range_error_per_m: float = 0.0
    points_at_1_m: float = 0.0
    percentile: float = 10.0


@dataclass(frozen=True)
class Nearest:
    """The nearest confirmed obstacle: metres from the vehicle's centre along the corridor, where, and how large what is seen of it is.

    The size is along the corridor, across and up, of the connected points in the corridor.
    """

    distance_m: float
    point_enu_m: tuple[float, float, float]
    size_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Ahead:
    """What is ahead: the nearest obstacle that is seen, or None; ``unknown`` is why a nearer one may be there unseen."""

    nearest: Nearest | None
    unknown: str = ""


def direction_of_motion(position_enu_m: NDArray[np.float64], nose: NDArray[np.float64], motion: VehicleMotion) -> NDArray[np.float64]:
    """Return the horizontal unit vector (3,) of the motion: of the velocity if moving, else towards the target, else of the nose.

    What is slow and not towards the target is the wind's push: the autopilot brings the vehicle back, and its way is to the target.
    """
    velocity = np.array(motion.velocity_enu_m_s[:2])
    to_target = np.zeros(2) if motion.target_enu_m is None else np.array(motion.target_enu_m[:2]) - position_enu_m[:2]
    to_go_m = float(np.linalg.norm(to_target))
    if to_go_m > AT_TARGET_M:
        towards = to_target / to_go_m
        pushed = velocity - max(float(velocity @ towards), 0.0) * towards
        velocity = velocity if np.linalg.norm(pushed) > PUSHED_M_S else np.zeros(2)
    for way, least in ((velocity, MOVING_M_S), (to_target, AT_TARGET_M), (nose, 0.0)):
        length = float(np.hypot(way[0], way[1]))
        if length > least:
            return np.array([way[0] / length, way[1] / length, 0.0])
    return np.array([1.0, 0.0, 0.0])


def corridor_coordinates(
    points_enu_m: NDArray[np.float64], origin_enu_m: NDArray[np.float64], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (N, 3): metres ahead, to the left and above the origin, seen along the horizontal direction."""
    axes = np.array([direction, [-direction[1], direction[0], 0.0], [0.0, 0.0, 1.0]])
    seen: NDArray[np.float64] = (points_enu_m - origin_enu_m) @ axes.T
    return seen
