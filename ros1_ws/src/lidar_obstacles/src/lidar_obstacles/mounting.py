"""Is the LiDAR mounted as configured? What stands still must stay where it is while the vehicle moves, and the ground is below.

A sweep of a mirrored, turned or overturned sensor looks like any other; how it changes with the vehicle's own motion does not. Planes are
fitted to all returns of a sweep, one in each cube of a grid: so walls count by their area, however dense the sensor is and whatever else it
sees. The walls among them, and posts such as trunks, are held against those of a look before, by the vehicle's poses: with the mount as it
is told, as if it were mirrored, or turned by quarters, and as if the vehicle had not moved: a sensor that repeats what it saw, noise,
another order of the points and all, sees nothing move. An overturned sensor moves rightly as long as it flies level, but has level surfaces
above it and none below. Where there is nothing to hold against each other, a mount that was not judged before is unknown.
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
CELL_M, LEAST_RETURNS = 1.0, 9  # edge of the cubes, and returns of one that can be a plane
FLAT_M, WIDE_M = 0.06, 0.12  # deviation across a plane at most, and along its shorter side at least: the points of a ring are a line
UPRIGHT, LEVEL = 0.35, 0.9  # of the normals' z
SLIM_M, LONG_M = 0.15, 0.2  # deviation across a post at most, and along it at least
NOTHING_BESIDE = 3  # returns in the cubes around a post: a single ring on a wall is as slim, but has others beside it
KNOTS = 8  # poses within a sweep
BESIDE_M = 1.5  # from a wall to what is compared with it
FITS_M, FITS_COSINE = 0.2, 0.9
FITS_POST_M = 0.3  # another side of it is seen from elsewhere
PAIRS = 8  # of walls, a square metre each, and posts, a metre each; with fewer nothing is said
UNJUDGED_S = 5.0  # of motion, in which too little was seen to judge a mount that was not judged before
FITTING = ((0.7, 0.2), (0.4, 0.3))  # shares of the pairs that fit with the sensor turned, and by how much they are greater than as told
"""Where motion and walls do not tell, all shares are alike; among trees fewer fit."""
ALIKE = 0.01  # by which two shares may differ that tell nothing apart: on a way straight to a wall, turned back and mirrored are the same
SAME_M, REPEATED = 0.1, 0.9  # apart at most, and share, of what a sensor that repeats what it saw has where it was: all, but for noise
TELLING_M, STILL = 0.3, 0.8  # that the motion makes of walls and posts which tell a repeat from a good sensor; share that it did not move
LEAST_REPEATED = 16  # walls and posts: of eight all stay by chance, where the ground and a fence are cut out alike on the way
LOOKS = 2  # in a row that say the same
ACROSS = 0.7  # of a wall's normal along one of two axes: walls along the way do not show whether the sensor is displaced along it
PAIRS_ACROSS, BACK = 4, 0.7  # pairs for each of these axes, and share of them that are where they were
APART_M = 20.0  # of way since a sudden change on which there was too little to hold against what was seen before it
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
    """Planes and posts of a sweep: places and normals (N, 3) in base_link's axes from the sensor on, and the poses of each one's moment.

    ``posts`` (N,) are those that are long and slim; instead of a normal they have the direction in which they are long.
    """

    stamp_ns: int
    places: Floats
    normals: Floats
    posts: NDArray[np.bool_]
    rotations: Floats
    origins: Floats

    def in_map(self, turn: Floats) -> tuple[Floats, Floats]:
        """Return places and normals in the map, the sensor turned."""
        rotations = self.rotations @ turn
        return np.einsum("nij,nj->ni", rotations, self.places) + self.origins, np.einsum("nij,nj->ni", rotations, self.normals)

    def upright(self) -> _Look:
        """Return only the walls and the posts."""
        up = np.abs(np.einsum("nj,nj->n", self.rotations[:, 2], self.normals))
        kept = np.where(self.posts, up > LEVEL, up < UPRIGHT)
        parts = (each[kept] for each in (self.places, self.normals, self.posts, self.rotations, self.origins))
        return _Look(self.stamp_ns, *parts)

    def level(self) -> Floats:
        """Return how high above the sensor the level planes are, metres."""
        level = ~self.posts & (np.abs(np.einsum("nj,nj->n", self.rotations[:, 2], self.normals)) > LEVEL)
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
        self._as_told = False  # whether walls have stayed where they were, with the mount as it is told
        self._unjudged_ns = 0  # of motion
        self._good: _Look | None = None  # the last look before a sudden change, as long as that lasts
        self._held, self._alike = False, 0  # whether there is a change; looks in a row that were as the good one
        self._apart_m = 0.0  # of way since the last one that could be held against it
        self._above, self._below = 0.0, 0.0

    def finding(self, sweep: Sweep, T_base_lidar: Floats, poses: PoseBuffer, *, self_m: float) -> Finding:  # noqa: N803 -- T_target_source
        """Return the finding about the mount by this sweep and those before it; without poses the finding before."""
        with suppress(PoseUnavailableError):
            pose = poses.at([sweep.end_ns]).matrix()
            if self._due(sweep, pose):
                self._look(sweep, pose, T_base_lidar, poses, self_m)
        if self._times >= LOOKS:
            return self._found()
        if self._overturned:
            return unsure(
                FaultKind.CALIBRATION,
                "level surfaces above the LiDAR and none below",
                "it is upside down",
                "there is a ceiling, and nothing below",
            )
        if not self._as_told and self._unjudged_ns > UNJUDGED_S * NS:
            told = "by the vehicle's own motion it can't be judged how the LiDAR is mounted"
            return unsure(FaultKind.CALIBRATION, told, f"too few walls and posts within {FARTHEST_M:g} m", "ranges or poses that scatter")
        return FINE

    def hold(self, *, changed: bool) -> None:
        """Report, before each sweep, whether the surroundings have suddenly changed: the last look before is then kept."""
        if changed and not self._held:
            self._good, self._alike, self._apart_m = (None if self._before is None else self._before[1]), 0, 0.0
        self._held = changed

    @property
    def back(self) -> bool:
        """Whether, after a sudden change, walls and posts are where they were before it."""
        return self._held and self._alike >= LOOKS

    @property
    def apart(self) -> bool:
        """Whether, after a sudden change, the vehicle has gone far with too little in view that it saw before: it can't be judged then."""
        return self._held and self._apart_m >= APART_M

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
        soon = self._looks < FIRST_LOOKS or bool(self._suspected) or self._held or not self._upright
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
            before, self._before = self._before, (pose, look.upright())
            if self._held and before is not None:
                self._hold_against(self._before[1], moved_m)
            if before is not None and not old:
                self._compare(before[1], self._before[1])

    def _hold_against(self, now: _Look, moved_m: float) -> None:
        """Count the looks that are as the one before the sudden change, and the way on which they could not be held against it."""
        back = None if self._good is None else _back(self._good, now)
        self._alike = self._alike + 1 if back else 0
        self._apart_m = self._apart_m + moved_m if back is None else 0.0

    def _compare(self, before: _Look, now: _Look) -> None:
        """Count the looks that say that the sensor is turned in the same way. A fault that was found stays until motion shows otherwise."""
        as_told = _fitting(before, now, np.eye(3))
        if as_told is None:
            self._unjudged_ns += abs(now.stamp_ns - before.stamp_ns)
            return
        found = self._times >= LOOKS
        if _stands_still(before, now):
            self._times, self._suspected = (self._times + 1 if FROZEN in self._suspected else 1), {FROZEN}
            return
        if as_told > 1.0 - FITTING[0][1] and not found:
            self._suspected, self._times, self._as_told = set(), 0, True
            return
        shares = {name: _fitting(before, now, turn) or 0.0 for name, turn in OTHERS.items()}
        shares[FROZEN] = _repeated(before, now)
        best = max(shares.values())
        if any(best >= max(share, as_told + better) for share, better in FITTING):
            alike = {name for name, share in shares.items() if share >= best - ALIKE}
            self._times = self._times + 1 if alike & self._suspected else 1
            self._suspected = alike & self._suspected or alike
        elif not found or as_told >= max(shares[name] for name in self._suspected) + FITTING[0][1]:
            self._suspected, self._times = set(), 0

    def _found(self) -> Finding:
        """Return the finding with the causes that the walls showed: all of them, where the motion does not distinguish them."""
        if self._suspected == {FROZEN}:
            told = "the sweeps do not change with the vehicle's own motion"
            return broken(FaultKind.FROZEN, told, "the LiDAR repeats what it saw", "the vehicle stands and its poses move")
        names = [name for name in (*OTHERS, FROZEN) if name in self._suspected]
        told = f"by the vehicle's own motion the LiDAR is {' or '.join(names)}"
        return broken(FaultKind.CALIBRATION, told, "/tf_static does not tell how it is mounted", "its driver has other axes")


@dataclass(frozen=True)
class _Pairs:
    """Walls and posts of two looks side by side: normals (N, 3) of the walls, and which walls (N,) and posts (M,) are where they were."""

    normals: Floats
    walls: NDArray[np.bool_]
    posts: NDArray[np.bool_]

    @classmethod
    def of(cls, before: _Look, now: _Look, turn: Floats) -> _Pairs:
        """Hold two looks against each other, both turned."""
        places, normals = before.in_map(turn)
        seen, facing = now.in_map(turn)
        across: Floats = np.empty((0, 3))
        walls: NDArray[np.bool_] = np.empty(0, np.bool_)
        posts: NDArray[np.bool_] = np.empty(0, np.bool_)
        if not (before.posts.all() or now.posts.all()):
            of_wall, mine = ~before.posts, ~now.posts
            distance, nearest = cKDTree(places[of_wall]).query(seen[mine])
            beside, wall = distance < BESIDE_M, normals[of_wall][nearest]
            off_m = np.abs(np.einsum("nj,nj->n", wall, seen[mine] - places[of_wall][nearest]))
            alike = np.abs(np.einsum("nj,nj->n", wall, facing[mine])) > FITS_COSINE
            across, walls = wall[beside], ((off_m < FITS_M) & alike)[beside]
        if before.posts.any() and now.posts.any():
            apart: Floats = cKDTree(places[before.posts, :2]).query(seen[now.posts, :2])[0]  # at any height
            posts = apart[apart < BESIDE_M] < FITS_POST_M
        return cls(across, walls, posts)


def _fitting(before: _Look, now: _Look, turn: Floats) -> float | None:
    """Return which share of the walls and posts is where it was, both looks turned; None with too few of them side by side."""
    pairs = _Pairs.of(before, now, turn)
    fitting = np.concatenate([pairs.walls, pairs.posts])
    return float(np.mean(fitting)) if len(fitting) >= PAIRS else None


def _repeated(before: _Look, now: _Look) -> float:
    """Return the share of walls and posts that the sensor sees at the very place where it saw them, where that is nearly all; otherwise 0.

    Walls along the way and what is cut out of them by the rings go along with the vehicle, too, but not to a decimetre.
    """
    if min(len(before.places), len(now.places)) < LEAST_REPEATED:
        return 0.0
    share = float(np.mean(cKDTree(before.places).query(now.places)[0] < SAME_M))
    return share if share >= REPEATED else 0.0


def _stands_still(before: _Look, now: _Look) -> bool:
    """Return whether the sensor sees nearly all where it saw it, what the vehicle's motion must have moved, too.

    In a street most walls are along the way, and fit with the motion and without it: a few across it tell.
    """
    if not _repeated(before, now):
        return False
    came_m = np.einsum("nji,nj->ni", now.rotations, now.origins - before.origins.mean(axis=0))
    moves_m = np.where(now.posts, np.linalg.norm(came_m, axis=1), np.abs(np.einsum("nj,nj->n", now.normals, came_m)))
    telling = now.places[moves_m >= TELLING_M]
    if len(telling) < PAIRS:
        return False
    return bool(np.mean(cKDTree(before.places).query(telling)[0] < SAME_M) >= STILL)


def _back(good: _Look, now: _Look) -> bool | None:
    """Return whether what stands across each of two horizontal axes is where it was in a good look; posts stand across both.

    None where too little of both looks is side by side to tell it for each axis, and nothing is elsewhere.
    """
    pairs = _Pairs.of(good, now, np.eye(3))
    level = pairs.normals[:, :2]
    across = [np.concatenate([pairs.walls[np.abs(level @ axis) > ACROSS], pairs.posts]) for axis in np.linalg.eigh(level.T @ level)[1].T]
    told = [fitting for fitting in across if len(fitting) >= PAIRS_ACROSS]
    if any(np.mean(fitting) < BACK for fitting in told):
        return False
    return True if len(told) == len(across) else None


def _planes(sweep: Sweep, T_base_lidar: Floats, poses: PoseBuffer, least_m: float) -> _Look:  # noqa: N803 -- T_target_source
    usable = sweep.within(least_m, FARTHEST_M)
    if not len(usable.points):
        nothing = np.empty((0, 3))
        return _Look(sweep.stamp_ns, nothing, nothing, np.empty(0, np.bool_), np.empty((0, 3, 3)), nothing)
    cells = _Cells.of(usable.points @ T_base_lidar[:3, :3].T, usable.times_s.astype(np.float64))
    spread, axes = np.linalg.eigh(cells.covariances)
    flat = (spread[:, 0] < FLAT_M**2) & (spread[:, 1] > WIDE_M**2)
    posts = (spread[:, 1] < SLIM_M**2) & (spread[:, 2] > LONG_M**2) & cells.alone & ~flat
    normals = np.where(posts[:, None], axes[:, :, 2], axes[:, :, 0])
    knots_s = np.linspace(usable.times_s.min(), usable.times_s.max(), KNOTS)
    at_knots = poses.at([sweep.stamp_ns + int(knot * NS) for knot in knots_s])
    kept = flat | posts
    knot = np.searchsorted(knots_s, cells.times_s[kept] - (knots_s[1] - knots_s[0]) / 2.0).clip(0, KNOTS - 1)
    origins = at_knots.position + at_knots.rotation @ T_base_lidar[:3, 3]
    return _Look(sweep.stamp_ns, cells.places[kept], normals[kept], posts[kept], at_knots.rotation[knot], origins[knot])


@dataclass(frozen=True)
class _Cells:
    """The returns of the cubes with enough of them: their middle (N, 3), covariance (N, 3, 3) and mean time (N,).

    ``alone`` (N,) are those with nothing in the cubes beside them.
    """

    places: Floats
    covariances: Floats
    times_s: Floats
    alone: NDArray[np.bool_]

    @classmethod
    def of(cls, points: Floats, times_s: Floats) -> _Cells:
        """Sum up points (N, 3) and their times (N,), cube by cube."""
        half = int(np.ceil(FARTHEST_M / CELL_M)) + 1
        shape = (2 * half,) * 3
        corner = np.floor(points / CELL_M)
        cell = ((corner + half) @ [shape[1] * shape[2], shape[2], 1]).astype(np.intp)
        counts = np.bincount(cell, minlength=int(np.prod(shape)))
        chosen = np.flatnonzero(counts >= LEAST_RETURNS)
        # From the cube's own corner: squares of places far away would lose the millimetres.
        inside = (points - corner * CELL_M).T

        def mean(values: Floats) -> Floats:
            means: Floats = np.bincount(cell, weights=values, minlength=len(counts))[chosen] / counts[chosen]
            return means

        middle = np.stack([mean(axis) for axis in inside], axis=1)
        squares = {(i, j): mean(inside[i] * inside[j]) - middle[:, i] * middle[:, j] for i in range(3) for j in range(i, 3)}
        covariances = np.stack([squares[min(i, j), max(i, j)] for i in range(3) for j in range(3)], axis=1).reshape(-1, 3, 3)
        grid = counts.reshape(shape)
        wide = np.pad(grid, ((1, 1), (1, 1), (0, 0)))
        around = sum(wide[x : x + shape[0], y : y + shape[1]] for x in range(3) for y in range(3)) - grid
        number = np.stack(np.unravel_index(chosen, shape), axis=1)
        return cls(middle + (number - half) * CELL_M, covariances, mean(times_s), around.reshape(-1)[chosen] < NOTHING_BESIDE)
