"""The health of a LiDAR by its sweeps: returns, where they come from, how far they are, whether they change."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from lidar_obstacles.range_gates import RangeGates
from lidar_obstacles.range_noise import Neighbours, RangeNoise, Specks
from lidar_obstacles.range_steps import FEW, RangeSteps, Seen
from lidar_obstacles.sudden_changes import SuddenChange
from perception_core import FINE, NS, FaultKind, Finding, Sweep, broken, unsure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SECTORS = 36
SECTOR_RAD = 2.0 * np.pi / SECTORS
LOST_TOGETHER = 3  # neighbouring sectors that no edge of a wall takes away from one sweep to the next
LONG_AGO_NS = -(10**12)
GONE_S = 1.0  # for so long the way through a sector that lost its returns counts as not seen
SAMPLE = 8_000  # points are enough to judge a sweep
RECENT = 3  # sweeps: a sensor loses a sector from one to the next, a moving one gradually
SECTOR_RETURNS = 50  # of the sample; a sector with fewer can't be missed
NEAR = 1.5  # of the vehicle's radius: what comes nearer soon is taken for the vehicle, or is too near to be seen
LEFT_BEHIND_M = 5.0  # from where returns were lost: what was seen there tells nothing of what is to be seen here
BLIND_RETURNS = 5  # of the sample: with as many, a sector is not blind
NO_UNIT_M = 1e7  # a range beyond is none in millimetres either
UNITS = "the coordinates are in millimetres or centimetres", "the fields are at other places"
BYTES = "the order of the bytes (is_bigendian) is another one", "the fields are at other places"
REPEATED_OF, SAME = 4, 1e-9  # sweeps that may come again; metres, and share of the sums: noise changes these by millimetres at least
FROZEN_SHARE = 0.9  # of the points, at the same place to the last bit


@dataclass(frozen=True)
class CloudLimits:
    """When a sweep counts as faulty.

    Fewer than ``min_returns`` are nothing; fewer than ``thin_share`` of what came just before is a broken sensor; more than ``far_share``
    of the returns beyond ``max_range_m`` are coordinates in another unit. A sector is lost with less than ``sector_share`` of what it had.
    Ranges on all sides that change faster than ``max_speed_m_s`` are no motion. Where surfaces are smooth, ranges do not begin to scatter
    by more than ``max_noise_m`` from one sweep to the next.
    """

    min_returns: int = 100
    thin_share: float = 0.6
    max_range_m: float = 250.0
    far_share: float = 0.05
    sector_share: float = 0.3
    max_speed_m_s: float = 3.0
    max_noise_m: float = 0.12


class CloudJudge:
    """Judge sweeps in their order; not thread-safe.

    A sector whose surfaces came nearer than the sensor sees, as the ground does at a landing, is hidden: it may be lost or not, and is not
    missed before it has returns again. One or two neighbouring sectors may lose their returns at the edge of a wall: that is no fault, but
    ``gone`` tells of them. So may more of them where the returns became fewer from sweep to sweep before, as beside a wall that ends. Where
    such a gap is empty and has returns on both sides it is no edge: ``gone`` tells of it until returns come from there again.

    What is lost, or scatters, stays so until the returns are back, or the vehicle is `LEFT_BEHIND_M` away from where it began: the sensor
    is then judged as one that was just started, but ``gone`` tells of the lost sectors until returns come from them.
    """

    def __init__(self, limits: CloudLimits) -> None:
        self._limits = limits
        self._previous: NDArray[np.float32] = np.empty((3, 0), dtype=np.float32)
        self._recent: deque[_Sectors] = deque(maxlen=RECENT)
        self._lost: NDArray[np.bool_] = np.zeros(SECTORS, dtype=np.bool_)
        self._blind: NDArray[np.bool_] = np.zeros(SECTORS, dtype=np.bool_)
        self._lost_at_m: Floats | None = None
        self._looks = 0
        self._last: tuple[int, Floats | None] = 0, None
        self._noise = RangeNoise(limits.max_noise_m)
        self._specks = Specks()
        self._gates = RangeGates()
        self._steps = RangeSteps(limits.max_speed_m_s)
        self._changes = SuddenChange()
        self._repeats = Repeats()
        self._turned_rad = 0.0
        self._gone_ns: NDArray[np.int64] = np.full(SECTORS, LONG_AGO_NS, dtype=np.int64)
        """By the sectors of a sensor that has not turned."""
        self.gone: NDArray[np.bool_] = np.zeros(SECTORS, dtype=np.bool_)
        """Sectors (SECTORS,), from -180 degrees around the sensor's z axis on, that lost their returns in the last `GONE_S` seconds.

        Those that had lost them where the vehicle was before stay in it.
        """

    def finding(
        self, sweep: Sweep, *, self_m: float, position_m: Floats | None = None, turned_rad: float = 0.0, tilted_rad: float = 0.0
    ) -> Finding:
        """Return the finding about a sweep; returns nearer than ``self_m`` are the vehicle's own. Its position (3,) is None while unknown.

        ``turned_rad``: by how much the sensor has turned about its z axis since the sweep before. What it saw has then moved to other
        sectors: a vehicle that leans in a gust loses nothing. ``tilted_rad``: by how much its z axis has turned.
        """
        self._turned_rad += turned_rad
        if self._left_behind(position_m):
            self._forget()
        taken = self._taken(sweep, self_m, position_m)
        checks = (self._unusable, self._repeated, self._scattered, self._stepped, self._missing)
        finding = next((found for check in checks if (found := check(taken)) is not None), None)
        if finding is None:
            self._changes.take(taken.cells_m, sweep.stamp_ns, position_m=position_m, tilted_rad=tilted_rad, clear=taken.clear)
            finding = self._in_the_air(taken)
        return finding or FINE

    @property
    def changed(self) -> Finding:
        """Whether good sweeps see their surroundings elsewhere at once: of less weight than what is found of the mount."""
        return self._changes.finding

    def after_change(self, *, back: bool, apart: bool) -> None:
        """Report how walls and posts are after a sudden change: back where they were, or too few of them in view."""
        if back:
            self._changes.forget()
        self._changes.part(apart=apart)

    def _taken(self, sweep: Sweep, self_m: float, position_m: Floats | None) -> _Taken:
        """Return what is looked at of a sweep, and of those before it."""
        stride = max(1, len(sweep.points) // SAMPLE) | 1  # odd: every second ring, or every 16th, is no sample of a sweep
        sample = np.ascontiguousarray(sweep.points[::stride].T)
        previous, self._previous = self._previous, sample
        ranges_m = np.sqrt(np.einsum("ij,ij->j", sample, sample))
        seen = Seen.of(sample, ranges_m)
        self._looks += 1
        return _Taken(
            sweep=sweep,
            number=self._looks,
            stride=stride,
            sample=sample,
            previous=previous,
            returned=ranges_m > self_m,
            outside=seen.select(seen.ranges_m > self_m),
            sectors=_sectors(seen, stride, self_m, self._turned_rad),
            before=self._lately(),
            self_m=self_m,
            turned_rad=self._turned_rad,
            position_m=position_m,
            moved_m=self._moved_m(sweep.stamp_ns, position_m),
        )

    def _unusable(self, taken: _Taken) -> Finding | None:
        """Return what is wrong with a sweep that is no sweep, or is in another unit."""
        count = len(taken.outside.ranges_m) * taken.stride
        if count < self._limits.min_returns:
            return self._too_few(count, taken.before, taken.self_m)
        return self._far(taken.outside.ranges_m)

    def _repeated(self, taken: _Taken) -> Finding | None:
        """Return that the sweep was there before."""
        if _frozen(taken.sample, taken.previous, taken.returned):
            return broken(FaultKind.FROZEN, "the sweep is the same as the one before", "the driver repeats it", "the sensor hangs")
        if self._repeats.again(taken.sweep):
            told = f"the sweep has the points of one of the last {REPEATED_OF}"
            return broken(FaultKind.FROZEN, told, "the driver repeats it", "an old buffer is sent anew")
        return None

    def _scattered(self, taken: _Taken) -> Finding | None:
        """Return that the ranges scatter as they did not before."""
        noise_m = self._noise.risen_m(taken.neighbours)
        if not noise_m:
            return None
        self._lost_at_m = taken.position_m if self._lost_at_m is None else self._lost_at_m
        told = f"the ranges scatter by {noise_m:.2f} m where they are smoothest"
        return broken(FaultKind.RANGE, told, "the sensor is failing", "dust or fog is around it")

    def _stepped(self, taken: _Taken) -> Finding | None:
        """Return that all ranges became longer, or shorter."""
        off_m = self._steps.offset_m(taken.cells_m, taken.sweep.stamp_ns, clear=taken.clear, position_m=taken.position_m)
        if not off_m:
            return None
        told = f"all ranges became at least {abs(off_m):.1f} m {'longer' if off_m > 0 else 'shorter'} from one sweep to the next"
        return broken(FaultKind.RANGE, told, "the driver has changed their unit or offset", "the vehicle's position has jumped")

    def _missing(self, taken: _Taken) -> Finding | None:
        """Return which returns are missed: most of them, those of some directions, or of some ranges."""
        lost = self._gates.lost(taken.outside.ranges_m, taken.stride, least_m=NEAR * taken.self_m, moved_m=taken.moved_m)
        finding = self._against_the_past(taken.sectors, taken.before, taken.stride, taken.sweep.stamp_ns)
        if finding is None and lost:
            causes = "the driver cuts these ranges off", "fog, dirt or light takes them"
            finding = broken(FaultKind.RANGE, f"no returns any more {lost}", *causes)
        if finding is None:
            self._lost_at_m = None
        elif self._lost_at_m is None:
            self._lost_at_m = taken.position_m
        return finding

    def _in_the_air(self, taken: _Taken) -> Finding | None:
        """Return that many returns stand alone."""
        share = self._specks.share(taken.neighbours)
        if not share:
            return None
        told = f"{share:.1%} of the returns stand alone in the air"
        return unsure(FaultKind.RANGE, told, "rain, dust or snow", "the light of another LiDAR")

    def _moved_m(self, stamp_ns: int, position_m: Floats | None) -> float:
        """Return how far the vehicle may have come since the sweep before: by its position (3,), else by its greatest speed."""
        then_ns, then_m = self._last
        self._last = stamp_ns, position_m
        if position_m is not None and then_m is not None:
            return float(np.linalg.norm(position_m - then_m))
        return self._limits.max_speed_m_s * abs(stamp_ns - then_ns) / NS

    def _left_behind(self, position_m: Floats | None) -> bool:
        """Return whether the vehicle has gone away from where the fault began; at a position (3,) that is not known it has not."""
        if self._lost_at_m is None or position_m is None:
            return False
        return bool(np.linalg.norm(position_m - self._lost_at_m) > LEFT_BEHIND_M)

    def _forget(self) -> None:
        self._blind |= self._of_sensor(self._lost)
        self._lost[:] = False
        self._recent.clear()
        self._noise.forget()
        self._gates.forget()
        self._lost_at_m = None

    def _lately(self) -> Floats:
        """Return how many returns each sector lately had at least, (SECTORS,); none where it is hidden."""
        if not self._recent:
            return np.zeros(SECTORS)
        hidden = np.any([sectors.near for sectors in self._recent], axis=0)
        return np.where(hidden, 0.0, np.min([sectors.counts for sectors in self._recent], axis=0))

    def _of_sensor(self, sectors: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return sectors (SECTORS,) that stood still as those of the sensor that has turned, to half a sector."""
        return np.roll(sectors, -round(self._turned_rad / SECTOR_RAD))

    def _expected(self, before: Floats) -> Floats:
        """Return how many returns each sector should have at least, (SECTORS,): what it lately had, less what it lately lost a sweep.

        A wall beside the vehicle that ends leaves the sectors that see it within some sweeps, a sensor's fault from one to the next.
        """
        if len(self._recent) < 2:
            return before
        lost = np.max(-np.diff([sectors.counts for sectors in self._recent], axis=0), axis=0)
        expected: Floats = np.maximum(before - np.maximum(lost, 0.0), 0.0)
        return expected

    def _too_few(self, count: int, before: Floats, self_m: float) -> Finding:
        told = f"{'only ' if count else ''}{count} returns"
        if self._recent and before.sum() < self._limits.min_returns:
            return unsure(FaultKind.RETURNS, told, f"what was around came nearer than {NEAR * self_m:g} m", "the sensor is covered")
        return broken(FaultKind.RETURNS, told, "the sensor is covered or has no power", "the coordinates are in another unit")

    def _far(self, ranges: NDArray[np.float32]) -> Finding | None:
        share = np.count_nonzero(ranges > self._limits.max_range_m) / len(ranges)
        if share <= self._limits.far_share:
            return None
        middle = float(np.median(ranges))
        causes = UNITS if middle > self._limits.max_range_m else ("max_range_m is not that of this sensor", UNITS[0])
        size = f"{middle:.1e}" if middle > NO_UNIT_M else f"{middle:.0f}"
        if float(ranges.max()) > NO_UNIT_M:
            causes = BYTES
        told = f"{share:.0%} of the returns are beyond {self._limits.max_range_m:g} m, half of all beyond {size} m"
        return broken(FaultKind.RANGE, told, *causes)

    def _against_the_past(self, sectors: _Sectors, before: Floats, stride: int, stamp_ns: int) -> Finding | None:
        counts, expected = sectors.counts, self._expected(before)
        gone = (before >= SECTOR_RETURNS * stride) & (counts < self._limits.sector_share * before)
        missed = gone & (expected >= SECTOR_RETURNS * stride) & (counts < self._limits.sector_share * expected)
        self._lost = (self._lost & gone) | _together(missed)
        thin = counts.sum() < self._limits.thin_share * expected.sum()
        if thin and (not self._lost.any() or self._lost[before > 0].all()):
            told = f"returns fell from {before.sum():.0f} to {counts.sum():.0f}"
            return broken(FaultKind.RETURNS, told, "packets or rings are lost", "the sensor is dirty")
        if self._lost.any():
            told = f"no returns any more from {_angles(self._of_sensor(self._lost))} around the sensor's z axis"
            return broken(FaultKind.SECTOR, told, "something covers the sensor", "the driver cuts these directions off")
        self._recent.append(sectors)
        self._gone_ns[counts >= SECTOR_RETURNS * stride] = LONG_AGO_NS
        self._gone_ns[gone] = stamp_ns
        holes = _holes(gone & (counts < BLIND_RETURNS * stride), counts >= SECTOR_RETURNS * stride)
        self._blind = (self._blind | self._of_sensor(holes)) & (sectors.of_sensor < BLIND_RETURNS * stride)
        lately = np.abs(stamp_ns - self._gone_ns) < GONE_S * NS  # a clock may have gone back
        self.gone = self._of_sensor(lately) | self._blind
        return None


@dataclass(frozen=True)
class _Sectors:
    """A sweep by sectors, (SECTORS,) each: returns from outside of the vehicle, and whether most are too near to stay in view.

    Sectors stand still where the sensor turns about its z axis, but for ``of_sensor``: the returns by the sensor's own.
    """

    counts: Floats
    near: NDArray[np.bool_]
    of_sensor: Floats


@dataclass(frozen=True)
class _Taken:
    """A sweep, its ``number``, and what is looked at of it.

    Attributes:
        stride: of the points that are looked at.
        sample: these, (3, N); ``previous`` are those of the sweep before, ``returned`` (N,) are no part of the vehicle.
        outside: those of them.
        before: returns that each sector lately had at least, (SECTORS,).
        self_m: radius of the vehicle.
        turned_rad: by how much the sensor has turned since it was started.
        position_m: of the vehicle, (3,), None while unknown.
        moved_m: how far it may have come since the sweep before.
    """

    sweep: Sweep
    number: int
    stride: int
    sample: NDArray[np.float32]
    previous: NDArray[np.float32]
    returned: NDArray[np.bool_]
    outside: Seen
    sectors: _Sectors
    before: Floats
    self_m: float
    turned_rad: float
    position_m: Floats | None
    moved_m: float

    @cached_property
    def neighbours(self) -> Neighbours:
        """Some returns with those beside them."""
        return Neighbours.of(self.sweep, self.number, self_m=self.self_m)

    @cached_property
    def cells_m(self) -> Floats:
        """The mean range in each direction, as of `Seen.mean_ranges`."""
        return self.outside.mean_ranges(self.turned_rad)

    @cached_property
    def clear(self) -> bool:
        """Whether few returns are near: on the ground, and just above it, small motions change all that is seen."""
        return bool(np.percentile(self.outside.ranges_m, FEW) > NEAR * self.self_m)


def _sectors(seen: Seen, stride: int, self_m: float, turned_rad: float) -> _Sectors:
    outside = seen.ranges_m > self_m
    own, sector = (_sector(seen.azimuth_rad, turn_rad) for turn_rad in (0.0, turned_rad))
    of_sensor, counts, near = (
        np.bincount(which, minlength=SECTORS) for which in (own[outside], sector[outside], sector[seen.ranges_m <= NEAR * self_m])
    )
    hidden = 2 * near > np.bincount(sector, minlength=SECTORS)
    return _Sectors(counts.astype(np.float64) * stride, hidden, of_sensor.astype(np.float64) * stride)


def _sector(azimuth_rad: NDArray[np.float32], turned_rad: float) -> NDArray[np.intp]:
    turned = (azimuth_rad + np.float32(np.pi + turned_rad % (2.0 * np.pi))) * np.float32(1.0 / SECTOR_RAD)
    sector: NDArray[np.intp] = turned.astype(np.intp) % SECTORS
    return sector


def _holes(gone: NDArray[np.bool_], seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the sectors that are gone between two that are seen: beside the edge of a wall, one side would be empty, too."""
    holes = np.zeros_like(gone)
    for length in range(1, LOST_TOGETHER):
        for start in np.flatnonzero(gone):
            run = np.arange(start, start + length) % SECTORS
            if gone[run].all() and seen[start - 1] and seen[(start + length) % SECTORS]:
                holes[run] = True
    return holes


def _together(gone: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the sectors that are gone with so many neighbours that `LOST_TOGETHER` in a row are."""
    starts = np.all([np.roll(gone, -k) for k in range(LOST_TOGETHER)], axis=0)
    together: NDArray[np.bool_] = np.any([np.roll(starts, k) for k in range(LOST_TOGETHER)], axis=0)
    return together


def _frozen(now: NDArray[np.float32], before: NDArray[np.float32], returned: NDArray[np.bool_]) -> bool:
    """Return whether nearly all of these points (3, N) that returned are where they were; the rest of the message may change."""
    if before.shape != now.shape or not returned.any():
        return False
    x, y, z = now == before
    return np.count_nonzero(x & y & z & returned) > FROZEN_SHARE * np.count_nonzero(returned)


class Repeats:
    """Recognises a repeated sweep by the sums of its points, in whatever order these come; not thread-safe."""

    def __init__(self) -> None:
        self._lately: deque[_Sums] = deque(maxlen=REPEATED_OF)

    def again(self, sweep: Sweep) -> bool:
        """Return whether one of the last sweeps had the same points."""
        now = _Sums(sweep.points)
        alike = [each for each in self._lately if len(each.points) == len(now.points)]
        self._lately.append(now)
        return any(now.same(each) for each in alike)


@dataclass(frozen=True)
class _Sums:
    """Points (N, 3), and their sums, formed when asked for."""

    points: NDArray[np.float32]

    @cached_property
    def sums(self) -> Floats:
        """The sum of each coordinate, (3,)."""
        sums: Floats = np.nansum(self.points, axis=0, dtype=np.float64)
        return sums

    def same(self, other: _Sums) -> bool:
        """Return whether the sums are the same; those that are not finite are not."""
        return bool(np.isfinite(self.sums).all() and np.allclose(self.sums, other.sums, rtol=SAME, atol=SAME))


def _angles(lost: NDArray[np.bool_]) -> str:
    """Return the lost sectors in words: one range of degrees where they touch, else each."""
    width = 360 // SECTORS
    starts = [k for k in np.flatnonzero(lost) if not lost[k - 1]]
    if not starts:
        return "all directions"
    texts = []
    for start in starts:
        length = next(n for n in range(1, SECTORS + 1) if not lost[(start + n) % SECTORS])
        texts.append(f"{start * width - 180} to {start * width - 180 + length * width} degrees")
    return " and ".join(texts)
