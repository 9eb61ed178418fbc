"""How much do ranges scatter where surfaces are smooth? A LiDAR's error is some centimetres; much more hides what is small.

In the directions of a plane the inverse range is linear: n * x = d with x = r * u gives 1 / r = (n * u) / d. So the inverse ranges of a
return's nearest neighbours in direction are fitted by such a function, and what is left over is noise, or a rough surface. Of all
neighbourhoods the smoothest quarter counts: trunks, walls, and ground are smooth, foliage and edges are not. High grass all around is
not smooth either, but a vehicle comes there gradually: a fault of the sensor begins from one sweep to the next.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from perception_core import Sweep

    Floats = NDArray[np.float64]

BLOCKS = 3  # of the message, of which all returns are taken: thinned out, neighbours would be too far apart
BLOCK_POINTS = 300  # in every order of the points, by columns, by rings or in rosettes, those of a block are close together
TURN = 0.382  # of the message, from one look to the next: so all directions have their turn
SEEDS = 60
NEIGHBOURS = 10
PARAMETERS = 3
TIME_RAD_S = 4.0  # so far apart in direction counts a second: a turning sensor sees the same direction twice, and another place
SMOOTHEST = 25.0  # percentile
LATELY = 30  # sweeps of which the usual noise is known
KNOWN = 5  # of them are enough
RISE = 3.0  # by which it is a fault's, above the usual one


class RangeNoise:
    """Hold the noise of each sweep's ranges against what it was lately; not thread-safe."""

    def __init__(self, most_m: float) -> None:
        self._most_m = most_m
        self._lately_m: deque[float] = deque(maxlen=LATELY)
        self._looks = 0

    def risen_m(self, sweep: Sweep, *, self_m: float) -> float:
        """Return the noise, metres, where it is more than ever is good and has risen at once; 0 where it is not."""
        self._looks += 1
        noise_m = range_noise_m(sweep, self._looks, self_m=self_m)
        if noise_m > self._most_m and len(self._lately_m) >= KNOWN and noise_m > RISE * float(np.median(self._lately_m)):
            return noise_m
        self._lately_m.append(noise_m)
        return 0.0

    def forget(self) -> None:
        """Forget the noise of the sweeps so far: the next ones are judged as those of a sensor that was just started."""
        self._lately_m.clear()


def range_noise_m(sweep: Sweep, look: int, *, self_m: float) -> float:
    """Return the deviation of the ranges where they are smoothest, of returns beyond ``self_m``; 0 where too few are close together.

    ``look`` counts the sweeps; each is looked at in other directions.
    """
    seen = _blocks(len(sweep.points), look)
    ranges = np.linalg.norm(sweep.points[seen].astype(np.float64), axis=1)
    usable = np.isfinite(ranges) & (ranges > self_m)
    seen, ranges = seen[usable], ranges[usable]
    if len(seen) < SEEDS:
        return 0.0
    times = np.nan_to_num(sweep.times_s[seen].astype(np.float64))
    near = np.column_stack([sweep.points[seen] / ranges[:, None], TIME_RAD_S * times])
    _, index = cKDTree(near).query(near[:: len(near) // SEEDS], k=NEIGHBOURS)
    return float(np.percentile(_residuals(near[index, :3], 1.0 / ranges[index]) * np.median(ranges[index], axis=1) ** 2, SMOOTHEST))


def _blocks(count: int, look: int) -> NDArray[np.int64]:
    """Return which of so many points are in the blocks of a look."""
    if count <= BLOCKS * BLOCK_POINTS:
        return np.arange(count)
    starts = [int((look * TURN + block / BLOCKS) % 1.0 * count) for block in range(BLOCKS)]
    return np.concatenate([(start + np.arange(BLOCK_POINTS)) % count for start in starts])


def _residuals(directions: Floats, inverse: Floats) -> Floats:
    """Return the deviation of inverse ranges (S, K) from linear functions of their directions (S, K, 3), (S,)."""
    scale = np.linalg.norm(directions - directions.mean(axis=1, keepdims=True), axis=2).max(axis=1) + 1e-9
    local = (directions - directions.mean(axis=1, keepdims=True)) / scale[:, None, None]
    # A patch of directions is flat: of its three axes and a constant, the one across the patch is left to the ridge.
    terms = np.concatenate([np.ones((*inverse.shape, 1)), local], axis=2)
    normal = np.einsum("ski,skj->sij", terms, terms) + 1e-6 * np.eye(terms.shape[2])
    solution = np.linalg.solve(normal, np.einsum("ski,sk->si", terms, inverse)[..., None])[..., 0]
    left_over = inverse - np.einsum("ski,si->sk", terms, solution)
    deviation: Floats = np.sqrt(np.sum(left_over**2, axis=1) / (inverse.shape[1] - PARAMETERS))
    return deviation
