"""A hundred and ten ways in which the sweeps of a LiDAR go wrong, each with the cause that a finding should name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from perception_core import NS, Sweep

Floats = NDArray[np.float64]
Rng = np.random.Generator


@dataclass(frozen=True)
class SweepInTime:
    """A sweep of a good recording that is to be broken: all sweeps, the number of this one and of the first broken one, and a generator.

    ``ahead`` (3,) is the vehicle's nose in the sensor's frame, ``up`` (3,) what is above it.
    """

    sweeps: Sequence[Sweep]
    number: int
    first: int
    rng: Rng
    ahead: Floats
    up: Floats

    @property
    def sweep(self) -> Sweep:
        """The good sweep."""
        return self.sweeps[self.number]

    @property
    def points(self) -> Floats:
        """Its points (N, 3)."""
        return self.sweep.points.astype(np.float64)

    def earlier(self, count: int) -> Sweep:
        """Return a good sweep so many before this one."""
        return self.sweeps[max(0, self.number - count)]

    def bearings_deg(self) -> Floats:
        """Return how far to the left of the nose each point is, seen from above, (N,)."""
        left = np.cross(self.up, self.ahead)
        points = self.points
        bearings: Floats = np.degrees(np.arctan2(points @ left, points @ self.ahead))
        return bearings

    def with_points(self, points: Floats) -> Sweep:
        """Return the sweep with other points (N, 3)."""
        return replace(self.sweep, points=points.astype(np.float32))


Break = Callable[[SweepInTime], Sweep]


@dataclass(frozen=True)
class CloudKind:
    """One way to be broken: what became of a sweep, or of its frame; any of the ``causes`` in a finding's words is the right one."""

    name: str
    parameter: str
    causes: tuple[str, ...]
    sweep: Break = lambda moment: moment.sweep
    frame: str = "lidar"
    harmless: bool = False  # ranges are right: a finding is no duty


def _kept(moment: SweepInTime, kept: NDArray[np.bool_]) -> Sweep:
    return moment.sweep.select(np.flatnonzero(kept))


# --- returns -------------------------------------------------------------------------------------------------------------------


def _one_of(count: int, moment: SweepInTime) -> Sweep:
    return _kept(moment, np.arange(len(moment.sweep.points)) % count == 0)


def _share(share: float, moment: SweepInTime) -> Sweep:
    return _kept(moment, moment.rng.random(len(moment.sweep.points)) < share)


def _packets_lost(share: float, moment: SweepInTime) -> Sweep:
    """Return a sweep of which packets of 384 points are lost."""
    packets = moment.rng.random(len(moment.sweep.points) // 384 + 1) >= share
    return _kept(moment, packets[np.arange(len(moment.sweep.points)) // 384])


def _replaced(share: float, value: float, moment: SweepInTime) -> Sweep:
    points = moment.points
    points[moment.rng.random(len(points)) < share] = value
    return moment.with_points(points)


def _far_lost(metres: float, moment: SweepInTime) -> Sweep:
    return _kept(moment, np.linalg.norm(moment.points, axis=1) < metres)


def _near_lost(metres: float, moment: SweepInTime) -> Sweep:
    return _kept(moment, np.linalg.norm(moment.points, axis=1) > metres)


def _rings_lost(chosen: Callable[[Floats], NDArray[np.bool_]], moment: SweepInTime) -> Sweep:
    """Return a sweep without the rings that are chosen by their elevation, degrees above the sensor's own plane."""
    points = moment.points
    return _kept(moment, ~chosen(np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))))


def _doubled(moment: SweepInTime) -> Sweep:
    return moment.sweep.select(np.repeat(np.arange(len(moment.sweep.points)), 2))


# --- directions ----------------------------------------------------------------------------------------------------------------


def _lost(low_deg: float, high_deg: float, moment: SweepInTime) -> Sweep:
    bearings = moment.bearings_deg()
    return _kept(moment, (bearings < low_deg) | (bearings > high_deg))


def _lost_ahead(width_deg: float, moment: SweepInTime) -> Sweep:
    return _lost(-width_deg / 2, width_deg / 2, moment)


def _sometimes(change: Break, moment: SweepInTime) -> Sweep:
    return change(moment) if moment.number % 2 else moment.sweep


def _angles_scatter(sigma_deg: float, moment: SweepInTime) -> Sweep:
    turns = Rotation.from_rotvec(moment.rng.normal(0.0, np.radians(sigma_deg), (len(moment.sweep.points), 3)))
    return moment.with_points(turns.apply(moment.points))


# --- ranges --------------------------------------------------------------------------------------------------------------------


def _longer(metres: float, moment: SweepInTime) -> Sweep:
    points = moment.points
    ranges = np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1e-6)
    return moment.with_points(points * np.maximum(1.0 + metres / ranges, 0.0))


def _scaled(factor: float, moment: SweepInTime) -> Sweep:
    return moment.with_points(factor * moment.points)


def _rescaled(ranges_of: Callable[[Floats, Rng], Floats], moment: SweepInTime) -> Sweep:
    points = moment.points
    ranges = np.maximum(np.linalg.norm(points, axis=1), 1e-6)
    return moment.with_points(points * (ranges_of(ranges, moment.rng) / ranges)[:, None])


def _noisy(sigma_m: float, moment: SweepInTime) -> Sweep:
    return _rescaled(lambda ranges, rng: ranges + rng.normal(0.0, sigma_m, len(ranges)), moment)


def _wrapped(metres: float, moment: SweepInTime) -> Sweep:
    return _rescaled(lambda ranges, _: ranges % metres, moment)


def _coarse(metres: float, moment: SweepInTime) -> Sweep:
    return _rescaled(lambda ranges, _: np.round(ranges / metres) * metres, moment)


def _one_range(metres: float, moment: SweepInTime) -> Sweep:
    return _rescaled(lambda ranges, rng: metres + rng.normal(0.0, 0.02, len(ranges)), moment)


def _bytes_swapped(moment: SweepInTime) -> Sweep:
    return replace(moment.sweep, points=moment.sweep.points.astype(np.float32).byteswap())


def _shifted_field(moment: SweepInTime) -> Sweep:
    """Return what is read four bytes too late: y, z and the brightness for x, y, z."""
    points = moment.points
    light = moment.rng.uniform(0.0, 255.0, len(points))
    return moment.with_points(np.column_stack([points[:, 1], points[:, 2], light]))


# --- what is not there ---------------------------------------------------------------------------------------------------------


def _in_the_air(
    share: float, low_m: float, high_m: float, moment: SweepInTime, *, low_deg: float = -180.0, high_deg: float = 180.0
) -> Sweep:
    """Return a sweep with a share of its rays between two bearings ended at random ranges before what is there."""
    bearings, points = moment.bearings_deg(), moment.points
    ranges = np.linalg.norm(points, axis=1)
    false_m = moment.rng.uniform(low_m, high_m, len(points))
    hit = (moment.rng.random(len(points)) < share) & (bearings >= low_deg) & (bearings <= high_deg) & (ranges > false_m)
    points[hit] *= (false_m[hit] / ranges[hit])[:, None]
    return moment.with_points(points)


def _arm(metres: float, width_m: float, moment: SweepInTime) -> Sweep:
    """Return a sweep with a part of the vehicle in view: an upright bar ahead, that goes with it."""
    bearings, points = moment.bearings_deg(), moment.points
    ranges = np.linalg.norm(points, axis=1)
    hit = (np.abs(bearings) < np.degrees(width_m / metres / 2)) & (ranges > metres)
    points[hit] *= ((metres + moment.rng.normal(0.0, 0.02, hit.sum())) / ranges[hit])[:, None]
    return moment.with_points(points)


def _ghosts(moment: SweepInTime) -> Sweep:
    """Return a sweep with the reflection of what is on the left, on the right of a mirror ahead."""
    bearings, points = moment.bearings_deg(), moment.points
    left = np.cross(moment.up, moment.ahead)
    mirrored = points - 2.0 * (points @ left)[:, None] * left
    seen = (bearings > 5.0) & (bearings < 40.0)
    chosen = np.flatnonzero(seen & (moment.rng.random(len(points)) < 0.5))
    sweep = moment.sweep
    return replace(
        sweep,
        points=np.concatenate([sweep.points, 0.5 * mirrored[chosen]]).astype(np.float32),
        times_s=np.concatenate([sweep.times_s, sweep.times_s[chosen]]),
    )


# --- mount ---------------------------------------------------------------------------------------------------------------------


def _turned(axis: str, degrees: float, moment: SweepInTime) -> Sweep:
    """Return what a sensor measures that is turned about the vehicle's axis: ahead, left or up."""
    axes = {"ahead": moment.ahead, "left": np.cross(moment.up, moment.ahead), "up": moment.up}
    return moment.with_points(Rotation.from_rotvec(np.radians(degrees) * axes[axis]).apply(moment.points))


def _mirrored(moment: SweepInTime) -> Sweep:
    left = np.cross(moment.up, moment.ahead)
    return moment.with_points(moment.points - 2.0 * (moment.points @ left)[:, None] * left)


def _mirrored_back(moment: SweepInTime) -> Sweep:
    return moment.with_points(moment.points - 2.0 * (moment.points @ moment.ahead)[:, None] * moment.ahead)


def _axes_swapped(order: tuple[int, int, int], moment: SweepInTime) -> Sweep:
    return moment.with_points(moment.points[:, order])


def _shifted(ahead_m: float, up_m: float, moment: SweepInTime) -> Sweep:
    return moment.with_points(moment.points + ahead_m * moment.ahead + up_m * moment.up)


# --- time ----------------------------------------------------------------------------------------------------------------------


def _frozen(noise_m: float, moment: SweepInTime) -> Sweep:
    last = replace(moment.sweeps[moment.first - 1], stamp_ns=moment.sweep.stamp_ns)
    return replace(last, points=last.points + moment.rng.normal(0.0, noise_m, last.points.shape).astype(np.float32)) if noise_m else last


def _flickering(moment: SweepInTime) -> Sweep:
    last = _frozen(0.0, moment)
    points = last.points.copy()
    points[0] += moment.rng.uniform(-0.1, 0.1)
    return replace(last, points=points)


def _in_other_order(moment: SweepInTime) -> Sweep:
    last = _frozen(0.0, moment)
    return last.select(moment.rng.permutation(len(last.points)))


def _in_turns(moment: SweepInTime) -> Sweep:
    return replace(moment.sweeps[moment.first - 1 - moment.number % 2], stamp_ns=moment.sweep.stamp_ns)


def _old(count: int, moment: SweepInTime) -> Sweep:
    return replace(moment.earlier(count), stamp_ns=moment.sweep.stamp_ns)


def _half_old(count: int, moment: SweepInTime) -> Sweep:
    now, old = moment.sweep, moment.earlier(count)
    half, old_half = len(now.points) // 2, len(old.points) // 2
    return replace(
        now,
        points=np.concatenate([now.points[:half], old.points[old_half:]]),
        times_s=np.concatenate([now.times_s[:half], old.times_s[old_half:]]),
    )


def _stamped(shift_s: float, moment: SweepInTime) -> Sweep:
    return replace(moment.sweep, stamp_ns=moment.sweep.stamp_ns + round(shift_s * NS))


def _stamp_stands(moment: SweepInTime) -> Sweep:
    return replace(moment.sweep, stamp_ns=moment.sweeps[moment.first - 1].stamp_ns)


def _times(change: Callable[[Floats], Floats], moment: SweepInTime) -> Sweep:
    return replace(moment.sweep, times_s=change(moment.sweep.times_s.astype(np.float64)).astype(np.float32))


RETURNS, SECTOR = ("returns",), ("no returns any more", "does not see")
RANGE, SCATTER = ("range", "returns any more"), ("scatter",)
UNITS, BYTES = ("millimetres", "beyond", "longer", "shorter"), ("order of the bytes", "millimetres", "fields", "returns")
AIR, MOUNT = ("rain", "dust", "alone in the air"), ("mount", "turned", "mirrored", "upside down", "motion")
FROZEN, STAMP = ("same as the one before", "repeats"), ("stamp", "old when it arrives")
TIMES = ("time",)


def _family(
    name: str, causes: tuple[str, ...], unit: str, change: Callable[..., Sweep], values: Sequence[float], harmless: Sequence[float] = ()
) -> list[CloudKind]:
    return [CloudKind(name, f"{value:g}{unit}", causes, partial(change, value), harmless=value in harmless) for value in values]


def _around(change: Callable[..., Sweep], low_deg: float, high_deg: float, *values: float) -> Break:
    return partial(change, *values, low_deg=low_deg, high_deg=high_deg)


CLOUDS: tuple[CloudKind, ...] = (
    CloudKind("no returns", "", RETURNS, partial(_share, 0.0)),
    *_family("one return of", RETURNS, "", _one_of, (500, 50, 10, 2)),
    *_family("share of the returns", RETURNS, "", _share, (0.3, 0.7), harmless=(0.7,)),
    *_family("packets lost", RETURNS, "", _packets_lost, (0.5,)),
    CloudKind("not finite", "all", RETURNS, partial(_replaced, 1.0, np.nan)),
    CloudKind("not finite", "half", RETURNS, partial(_replaced, 0.5, np.nan)),
    CloudKind("zeros", "half", RETURNS, partial(_replaced, 0.5, 0.0)),
    CloudKind("each point twice", "", RETURNS, _doubled, harmless=True),
    *_family("beyond some metres lost", (*RANGE, *RETURNS), " m", _far_lost, (4, 8)),
    *_family("nearer than some metres lost", (*RANGE, *RETURNS), " m", _near_lost, (3, 5)),
    CloudKind("rings lost", "every second degree", RETURNS, partial(_rings_lost, lambda up: np.floor(up) % 2 == 0), harmless=True),
    CloudKind("rings lost", "above", (*RETURNS, *SECTOR), partial(_rings_lost, lambda up: up > 0.0)),
    CloudKind("rings lost", "below", (*RETURNS, *SECTOR), partial(_rings_lost, lambda up: up < 0.0)),
    CloudKind("rings lost", "around the horizon", (*RETURNS, *SECTOR), partial(_rings_lost, lambda up: np.abs(up) < 3.0)),
    *_family("lost ahead", SECTOR, " degrees", _lost_ahead, (12, 20, 30, 90, 180)),
    CloudKind("lost ahead", "-12 to 13 degrees", SECTOR, partial(_lost, -12.0, 13.0)),
    CloudKind("lost at the side", "90 degrees", SECTOR, partial(_lost, 45.0, 135.0), harmless=True),
    CloudKind(
        "lost behind", "90 degrees", (*SECTOR, *RETURNS), lambda moment: _kept(moment, np.abs(moment.bearings_deg()) < 135.0), harmless=True
    ),
    CloudKind("lost ahead, every second sweep", "60 degrees", SECTOR, partial(_sometimes, partial(_lost_ahead, 60.0))),
    *_family("directions scatter", SCATTER, " degrees", _angles_scatter, (2, 5)),
    *_family("all ranges longer", RANGE, " m", _longer, (0.3, 0.5, 1, 2), harmless=(0.3,)),
    *_family("all ranges shorter", RANGE, " m", lambda value, moment: _longer(-value, moment), (0.3, 0.5, 1, 2), harmless=(0.3,)),
    *_family("all ranges times", RANGE, "", _scaled, (0.5, 0.9, 1.1, 2)),
    CloudKind("feet for metres", "", (*UNITS, *RANGE), partial(_scaled, 3.281)),
    CloudKind("centimetres for metres", "", (*UNITS, *RANGE), partial(_scaled, 100.0)),
    CloudKind("millimetres for metres", "", UNITS, partial(_scaled, 1000.0)),
    CloudKind("metres for millimetres", "", (*RETURNS, *UNITS), partial(_scaled, 0.001)),
    CloudKind("bytes in the other order", "", BYTES, _bytes_swapped),
    CloudKind("fields four bytes late", "", (*BYTES, *RANGE, *MOUNT), _shifted_field),
    *_family("ranges begin again after", RANGE, " m", _wrapped, (5, 10)),
    *_family("ranges in steps of", (*SCATTER, *RANGE), " m", _coarse, (0.5, 1)),
    CloudKind("all at one range", "3 m", RANGE, partial(_one_range, 3.0)),
    *_family("ranges scatter", SCATTER, " m", _noisy, (0.2, 0.3, 0.5, 1)),
    *_family("rain", AIR, " of the rays", lambda value, moment: _in_the_air(value, 1.5, 15.0, moment), (0.005, 0.01, 0.02, 0.05)),
    *_family("dust at 3 to 6 m", AIR, " of the rays", lambda value, moment: _in_the_air(value, 3.0, 6.0, moment), (0.02, 0.05, 0.2, 0.6)),
    CloudKind("dust ahead", "3 to 6 m, 0.3 of the rays", AIR, _around(_in_the_air, -30.0, 30.0, 0.3, 3.0, 6.0)),
    CloudKind("crosstalk over 12 degrees", "ahead", AIR, _around(_in_the_air, -6.0, 6.0, 0.5, 1.5, 10.0)),
    CloudKind("crosstalk over 12 degrees", "at the side", AIR, _around(_in_the_air, 84.0, 96.0, 0.5, 1.5, 10.0), harmless=True),
    CloudKind("a web before the sensor", "0.3 to 0.5 m", (*AIR, *RETURNS), partial(_in_the_air, 0.2, 0.3, 0.5)),
    CloudKind("an arm in view", "0.1 m wide at 2.8 m", (*AIR, "moves with the vehicle"), partial(_arm, 2.8, 0.1)),
    CloudKind("an arm in view", "0.5 m wide at 2.8 m", (*AIR, "moves with the vehicle"), partial(_arm, 2.8, 0.5)),
    CloudKind("an arm in view", "0.3 m wide at 1.5 m", (*AIR, "moves with the vehicle"), partial(_arm, 1.5, 0.3)),
    CloudKind("ghosts of a mirror", "", (*AIR, "returns"), _ghosts),
    CloudKind("mirrored", "left and right", MOUNT, _mirrored),
    CloudKind("mirrored", "ahead and behind", MOUNT, _mirrored_back),
    *_family("turned to the left", MOUNT, " degrees", partial(_turned, "up"), (5, 15, 90, -90, 180)),
    *_family("pitched", MOUNT, " degrees", partial(_turned, "left"), (5, -5, 15)),
    *_family("rolled", MOUNT, " degrees", partial(_turned, "ahead"), (10, 90, 180)),
    CloudKind("axes swapped", "x and y", MOUNT, partial(_axes_swapped, (1, 0, 2))),
    CloudKind("axes swapped", "y and z", MOUNT, partial(_axes_swapped, (0, 2, 1))),
    CloudKind("mounted elsewhere", "1 m ahead", MOUNT, partial(_shifted, 1.0, 0.0)),
    CloudKind("mounted elsewhere", "0.5 m lower", MOUNT, partial(_shifted, 0.0, 0.5)),
    CloudKind("frame_id unknown", "", ("frame_id",), frame="laser"),
    *_family("frozen, noise of", FROZEN, " m", _frozen, (0, 0.005, 0.02)),
    CloudKind("frozen", "but for a point", FROZEN, _flickering),
    CloudKind("frozen", "in another order", FROZEN, _in_other_order),
    CloudKind("two sweeps in turns", "", FROZEN, _in_turns),
    *_family("sweeps late, stamped anew", ("old", *FROZEN, *MOUNT), " sweeps", lambda value, moment: _old(int(value), moment), (3, 10)),
    CloudKind("half of the sweep old", "5 sweeps", ("old", *FROZEN, *MOUNT), partial(_half_old, 5)),
    *_family("stamp shifted", STAMP, " s", _stamped, (-1, -0.5, 0.3, 10)),
    CloudKind("stamp stands", "", STAMP, _stamp_stands),
    CloudKind("times", "all zero", TIMES, partial(_times, np.zeros_like), harmless=True),
    CloudKind("times", "backwards", TIMES, partial(_times, lambda times: times.max() - times), harmless=True),
    CloudKind("times", "milliseconds for seconds", TIMES, partial(_times, lambda times: 1000.0 * times)),
    CloudKind("times", "not finite", TIMES, partial(_times, lambda times: times * np.nan), harmless=True),
)
