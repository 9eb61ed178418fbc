"""From a sweep to the nearest obstacle ahead of the motion, and whether a cloud is fit to be used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from perception_core import Corridor, Motion, Nearest, PoseBuffer, Support, Sweep, deskew, direction_of_motion, nearest_obstacle

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class AheadSettings:
    """Where to look, and what to believe; returns nearer than ``self_m`` to the sensor are the vehicle's own."""

    corridor: Corridor
    support: Support
    self_m: float = 1.2


def obstacle_ahead(
    sweep: Sweep,
    *,
    T_base_lidar: NDArray[np.float64],  # noqa: N803 -- T_target_source
    poses: PoseBuffer,
    motion: Motion,
    settings: AheadSettings,
) -> Nearest | None:
    """Return the nearest obstacle in the corridor, in the map, or None; raise PoseUnavailableError.

    Distances are from where the vehicle was at the end of the sweep, the newest moment that the cloud speaks of.
    """
    reach_m = settings.corridor.length_m + 2.0 * settings.corridor.half_width_m
    near = sweep.within(settings.self_m, reach_m)
    in_map = deskew(near, poses, T_base_lidar)
    pose = poses.at([sweep.end_ns]).matrix()
    direction = direction_of_motion(pose[:3, 3], pose[:3, 0], motion)
    return nearest_obstacle(in_map, pose[:3, 3], direction, settings.corridor, settings.support)


class CloudJudge:
    """Find what is wrong with a cloud; not thread-safe. A working LiDAR always sees the ground, and never twice the same."""

    def __init__(self, *, min_returns: int, self_m: float) -> None:
        self._min_returns = min_returns
        self._self_m = self_m
        self._previous: bytes = b""

    def complaint(self, data: bytes, sweep: Sweep) -> str:
        """Return why the cloud (its raw bytes and its sweep) is of no use, or an empty text; call it once for each cloud, in order."""
        previous, self._previous = self._previous, data
        returns = len(sweep.within(self._self_m, float("inf")).points)
        if returns < self._min_returns:
            return f"cloud is empty: {returns} returns"
        return "cloud is frozen" if data == previous else ""
