"""How much do ranges scatter where surfaces are smooth? A LiDAR's error is some centimetres; much more hides what is small.

In the directions of a plane the inverse range is linear: n * x = d with x = r * u gives 1 / r = (n * u) / d. So the inverse ranges of a
return's nearest neighbours in direction are fitted by such a function, and what is left over is noise, or a rough surface. Of all
neighbourhoods the smoothest quarter counts: trunks, walls, and ground are smooth, foliage and edges are not. High grass all around is
not smooth either, but a vehicle comes there gradually: a fault of the sensor begins from one sweep to the next.

A return that is much nearer than all its neighbours is a drop of rain, or dust: what is solid gives several that are side by side.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
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
SEEDS, NOISE_SEEDS = 200, 60  # returns whose neighbours are looked for, and those of them at which a plane is fitted
NEIGHBOURS = 10
PARAMETERS = 3
TIME_RAD_S = 4.0  # so far apart in direction counts a second: a turning sensor sees the same direction twice, and another place
SMOOTHEST = 25.0  # percentile
LATELY = 30  # sweeps of which the usual noise is known
KNOWN = 5  # of them are enough
RISE = 3.0  # by which it is a fault's, above the usual one
BEFORE = 0.75  # of the range of all neighbours: what is nearer stands alone in the air
SPECK_SWEEPS = 10  # of which the share of such returns is taken
MOST_SPECKS = 0.006  # of the returns; good sweeps have 0.0002, a rain that makes 2 of 100 returns 0.011


@dataclass(frozen=True)
class Neighbours:
    """Some returns of a sweep with those that are next to them in direction: directions (S, K, 3), and ranges (S, K), itself first."""

    directions: Floats
    ranges_m: Floats

    @classmethod
    def of(cls, sweep: Sweep, look: int, *, self_m: float) -> Neighbours:
        """Return those of returns beyond ``self_m``; ``look`` counts the sweeps, each is looked at in other directions."""
        seen = _blocks(len(sweep.points), look)
        ranges = np.linalg.norm(sweep.points[seen].astype(np.float64), axis=1)
        usable = np.isfinite(ranges) & (ranges > self_m)
        seen, ranges = seen[usable], ranges[usable]
        if len(seen) < NOISE_SEEDS:
            return cls(np.empty((0, NEIGHBOURS, 3)), np.empty((0, NEIGHBOURS)))
        times = np.nan_to_num(sweep.times_s[seen].astype(np.float64))
        near = np.column_stack([sweep.points[seen] / ranges[:, None], TIME_RAD_S * times])
        _, index = cKDTree(near).query(near[:: max(1, len(near) // SEEDS)], k=NEIGHBOURS)
        return cls(near[index, :3], ranges[index])

    def specks(self) -> float:
        """Return the share that is much nearer than all of its neighbours; 0 with too few of them."""
        if not len(self.ranges_m):
            return 0.0
        return float(np.mean(self.ranges_m[:, 0] < BEFORE * self.ranges_m[:, 1:].min(axis=1)))

    def noise_m(self) -> float:
        """Return the deviation of the ranges where they are smoothest; 0 with too few of them."""
        if not len(self.ranges_m):
            return 0.0
        step = max(1, len(self.ranges_m) // NOISE_SEEDS)
        directions, ranges = self.directions[::step], self.ranges_m[::step]
        return float(np.percentile(_residuals(directions, 1.0 / ranges) * np.median(ranges, axis=1) ** 2, SMOOTHEST))


class RangeNoise:
    """Hold the noise of each sweep's ranges against what it was lately; not thread-safe."""

    def __init__(self, most_m: float) -> None:
        self._most_m = most_m
        self._lately_m: deque[float] = deque(maxlen=LATELY)

    def risen_m(self, neighbours: Neighbours) -> float:
        """Return the noise, metres, where it is more than ever is good and has risen at once; 0 where it is not."""
        noise_m = neighbours.noise_m()
        if noise_m > self._most_m and len(self._lately_m) >= KNOWN and noise_m > RISE * float(np.median(self._lately_m)):
            return noise_m
        self._lately_m.append(noise_m)
        return 0.0

    def forget(self) -> None:
        """Forget the noise of the sweeps so far: the next ones are judged as those of a sensor that was just started."""
        self._lately_m.clear()


class Specks:
    """Recognise rain, dust or snow by the returns that stand alone before what is behind them; not thread-safe."""

    def __init__(self) -> None:
        self._lately: deque[float] = deque(maxlen=SPECK_SWEEPS)

    def share(self, neighbours: Neighbours) -> float:
        """Return their share of the last sweeps where it is more than good ones have, else 0."""
        self._lately.append(neighbours.specks())
        share = float(np.mean(self._lately))
        return share if len(self._lately) >= KNOWN and share > MOST_SPECKS else 0.0


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
