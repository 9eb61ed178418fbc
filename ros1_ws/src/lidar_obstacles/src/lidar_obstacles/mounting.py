"""Is the LiDAR mounted as it is told? What stands still must stay where it is while the vehicle moves, and the ground is below.

A sweep of a mirrored, turned or overturned sensor looks like any other; how it changes with the vehicle's own motion does not. Small planes
are fitted to the sweeps that are looked at. The walls among them are held against those of a look before, by the vehicle's poses: with the
mount as it is told, as if it were mirrored, or turned by quarters, and as if the vehicle had not moved: a sensor that repeats what it saw,
noise, another order of the points and all, sees nothing move. An overturned sensor moves rightly as long as it flies level, but
has level surfaces above it and none below.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from perception_core import FINE, NS, FaultKind, Finding, PoseBuffer, PoseUnavailableError, Sweep, broken, unsure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOVED_M, TURNED_RAD = 0.5, np.radians(10.0)  # from one look to the next: a mirrored wall is off by twice as much
SOON_S, LATER_S = 0.3, 2.0  # between two looks that may tell something new, and of others
FIRST_LOOKS = 10
OLDEST_S = 5.0  # of what is compared: the autopilot's own drift
NEAREST, FARTHEST_M = 1.5, 20.0  # of the vehicle's radius; metres: beyond, an error of the attitude moves a wall more than the vehicle does
SAMPLE, SEEDS, NEIGHBOURS = 1800, 180, 9
FLAT_M, WIDE_M = 0.06, 0.12  # deviation across a plane at most, and along its shorter side at least: the points of a ring are a line
UPRIGHT, LEVEL = 0.35, 0.9  # of the normals' z
KNOTS = 8  # poses within a sweep
BESIDE_M = 1.5  # from a wall to what is compared with it
FITS_M, FITS_COSINE = 0.2, 0.9
PAIRS = 15  # of walls; with fewer nothing is said
FITTING = ((0.7, 0.2), (0.4, 0.3))  # shares of the pairs that fit with the sensor turned, and by how much they are greater than as told
"""Where motion and walls do not tell, all shares are alike; among trees fewer fit."""
ALIKE = 0.01  # by which two shares may differ that tell nothing apart: on a way straight to a wall, turned back and mirrored are the same
LOOKS = 2  # in a row that say the same
ABOVE_M, BELOW_M = 0.5, 0.05  # the sensor: level planes that count
LEVEL_PLANES, RARELY, FADING = 6.0, 0.2, 0.9  # of planes above, that many and the others rarer; by look

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
MIRROR = np.diag([1.0, -1.0, 1.0])
FROZEN = "frozen"
OTHERS = {
    "turned by 180 degrees": QUARTER @ QUARTER,
    "turned by 90 degrees to the left": QUARTER,
    "turned by 90 degrees to the right": QUARTER.T,
    "mirrored": MIRROR,
    "mirrored and turned by 180 degrees": QUARTER @ QUARTER @ MIRROR,
    "mirrored and turned by 90 degrees to the left": QUARTER @ MIRROR,
    "mirrored and turned by 90 degrees to the right": QUARTER.T @ MIRROR,
}
"""What the points would have to be turned by, in base_link, to be where they should."""


@dataclass(frozen=True)
class _Look:
    """Small planes of a sweep: places and normals (N, 3) in base_link's axes from the sensor on, and the poses of each one's moment."""

    stamp_ns: int
    places: Floats
    normals: Floats
    rotations: Floats
    origins: Floats

    def in_map(self, turn: Floats) -> tuple[Floats, Floats]:
        """Return places and normals in the map, the sensor turned."""
        rotations = self.rotations @ turn
        return np.einsum("nij,nj->ni", rotations, self.places) + self.origins, np.einsum("nij,nj->ni", rotations, self.normals)

    def unmoved(self) -> _Look:
        """Return the planes as they are seen from the vehicle, wherever it is."""
        unturned = np.broadcast_to(np.eye(3), self.rotations.shape)
        return _Look(self.stamp_ns, self.places, self.normals, unturned, np.zeros_like(self.origins))

    def walls(self) -> _Look:
        """Return only the planes that are upright."""
        kept = np.abs(np.einsum("nj,nj->n", self.rotations[:, 2], self.normals)) < UPRIGHT
        return _Look(self.stamp_ns, self.places[kept], self.normals[kept], self.rotations[kept], self.origins[kept])

    def level(self) -> Floats:
        """Return how high above the sensor the level planes are, metres."""
        level = np.abs(np.einsum("nj,nj->n", self.rotations[:, 2], self.normals)) > LEVEL
        above: Floats = np.einsum("nj,nj->n", self.rotations[:, 2], self.places)[level]
        return above


class MountCheck:
    """Look at sweeps from time to time, in their order; not thread-safe."""

    def __init__(self) -> None:
        self._before: tuple[Floats, _Look] | None = None
        self._looked_ns = -(10**12)
        self._looks = 0
        self._suspected: set[str] = set()
        self._times = 0
        self._above, self._below = 0.0, 0.0

    def finding(self, sweep: Sweep, T_base_lidar: Floats, poses: PoseBuffer, *, self_m: float) -> Finding:  # noqa: N803 -- T_target_source
        """Return what the sweep, together with those before it, tells of the mount; without poses what was found before."""
        with suppress(PoseUnavailableError):
            pose = poses.at([sweep.end_ns]).matrix()
            if self._due(sweep, pose):
                self._look(sweep, pose, T_base_lidar, poses, self_m)
        if self._times >= LOOKS:
            return self._found()
        if self._overturned:
            return unsure(FaultKind.CALIBRATION, "level surfaces above the LiDAR and none below: is it upside down?")
        return FINE

    @property
    def _overturned(self) -> bool:
        return self._above >= LEVEL_PLANES and self._below <= RARELY * self._above

    @property
    def _upright(self) -> bool:
        return self._below >= LEVEL_PLANES and self._above <= RARELY * self._below

    def _due(self, sweep: Sweep, pose: Floats) -> bool:
        since_s = abs(sweep.stamp_ns - self._looked_ns) / NS
        if since_s < SOON_S:
            return False
        moved_m, turned_rad = self._motion(pose)
        soon = self._looks < FIRST_LOOKS or bool(self._suspected) or not self._upright
        told = moved_m >= MOVED_M or not self._upright
        return bool(turned_rad >= TURNED_RAD or (told and (soon or since_s >= LATER_S)))

    def _motion(self, pose: Floats) -> tuple[float, float]:
        """Return metres and radians since the look that the next one is held against."""
        if self._before is None:
            return np.inf, np.inf
        then = self._before[0]
        cosine = (np.trace(then[:3, :3].T @ pose[:3, :3]) - 1.0) / 2.0
        return float(np.linalg.norm(pose[:3, 3] - then[:3, 3])), float(np.arccos(np.clip(cosine, -1.0, 1.0)))

    def _look(self, sweep: Sweep, pose: Floats, T_base_lidar: Floats, poses: PoseBuffer, self_m: float) -> None:  # noqa: N803
        self._looked_ns, self._looks = sweep.stamp_ns, self._looks + 1
        look = _planes(sweep, T_base_lidar, poses, NEAREST * self_m)
        heights_m = look.level()
        self._above = FADING * self._above + np.count_nonzero(heights_m > ABOVE_M)
        self._below = FADING * self._below + np.count_nonzero(heights_m < -BELOW_M)
        moved_m, turned_rad = self._motion(pose)
        old = self._before is None or not 0 <= sweep.stamp_ns - self._before[1].stamp_ns <= OLDEST_S * NS
        if old or moved_m >= MOVED_M or turned_rad >= TURNED_RAD:
            before, self._before = self._before, (pose, look.walls())
            if before is not None and not old:
                self._compare(before[1], self._before[1])

    def _compare(self, before: _Look, walls: _Look) -> None:
        """Count the looks that say that the sensor is turned in the same way. A fault that was found stays until motion shows otherwise."""
        as_told = _fitting(before, walls, np.eye(3))
        if as_told is None:
            return
        found = self._times >= LOOKS
        if as_told > 1.0 - FITTING[0][1] and not found:
            self._suspected, self._times = set(), 0
            return
        shares = {name: _fitting(before, walls, turn) or 0.0 for name, turn in OTHERS.items()}
        shares[FROZEN] = _fitting(before.unmoved(), walls.unmoved(), np.eye(3)) or 0.0
        best = max(shares.values())
        if any(best >= max(share, as_told + better) for share, better in FITTING):
            alike = {name for name, share in shares.items() if share >= best - ALIKE}
            self._times = self._times + 1 if alike & self._suspected else 1
            self._suspected = alike & self._suspected or alike
        elif not found or as_told >= max(shares[name] for name in self._suspected) + FITTING[0][1]:
            self._suspected, self._times = set(), 0

    def _found(self) -> Finding:
        """Return what the walls tell, once they have said it often enough: all that it may be, where the motion does not tell it apart."""
        if self._suspected == {FROZEN}:
            return broken(FaultKind.FROZEN, "the sweeps do not change with the vehicle's own motion: the LiDAR repeats what it saw")
        names = [name for name in (*OTHERS, FROZEN) if name in self._suspected]
        return broken(FaultKind.CALIBRATION, f"by the vehicle's own motion the LiDAR is {' or '.join(names)}")


def _fitting(before: _Look, now: _Look, turn: Floats) -> float | None:
    """Return which share of the walls is where it was, both looks turned; None with too few of them side by side."""
    places, normals = before.in_map(turn)
    if len(places) < PAIRS or len(now.places) < PAIRS:
        return None
    seen, facing = now.in_map(turn)
    distance, nearest = cKDTree(places).query(seen)
    beside = distance < BESIDE_M
    if np.count_nonzero(beside) < PAIRS:
        return None
    of_wall = normals[nearest[beside]]
    off_m = np.abs(np.einsum("nj,nj->n", of_wall, seen[beside] - places[nearest[beside]]))
    alike = np.abs(np.einsum("nj,nj->n", of_wall, facing[beside])) > FITS_COSINE
    return float(np.mean((off_m < FITS_M) & alike))


def _planes(sweep: Sweep, T_base_lidar: Floats, poses: PoseBuffer, least_m: float) -> _Look:  # noqa: N803 -- T_target_source
    usable = sweep.within(least_m, FARTHEST_M)
    stride = max(1, len(usable.points) // SAMPLE)
    points = usable.points[::stride] @ T_base_lidar[:3, :3].T
    times_s = usable.times_s[::stride].astype(np.float64)
    if len(points) < NEIGHBOURS:
        nothing = np.empty((0, 3))
        return _Look(sweep.stamp_ns, nothing, nothing, np.empty((0, 3, 3)), nothing)
    _, index = cKDTree(points).query(points[:: max(1, len(points) // SEEDS)], k=NEIGHBOURS)
    patches = points[index]
    places = patches.mean(axis=1)
    spread, axes = np.linalg.eigh(np.einsum("ski,skj->sij", patches - places[:, None], patches - places[:, None]) / NEIGHBOURS)
    flat = (spread[:, 0] < FLAT_M**2) & (spread[:, 1] > WIDE_M**2)
    knots_s = np.linspace(times_s.min(), times_s.max(), KNOTS)
    at_knots = poses.at([sweep.stamp_ns + int(knot * NS) for knot in knots_s])
    knot = np.searchsorted(knots_s, times_s[index[flat, 0]] - (knots_s[1] - knots_s[0]) / 2.0).clip(0, KNOTS - 1)
    origins = at_knots.position + at_knots.rotation @ T_base_lidar[:3, 3]
    return _Look(sweep.stamp_ns, places[flat], axes[flat, :, 0], at_knots.rotation[knot], origins[knot])
