"""What a hundred and twenty kinds of broken pictures, and a hundred and ten of broken clouds, make the nodes tell of the way ahead.

``./alula bench perception --breaks pictures clouds``. Each kind begins in three good recordings, with an obstacle ahead. It is judged by
what depths are for: it has a consequence where, in two measurements, an obstacle within `NEAR_M` is not told, or one that is not there is,
each by more than `OFF_M` (of pictures also by what an error of the disparity is there), while the sensor is believed. A kind that is known
within `KNOWN_S` has none in that recording; neither has one whose way ahead is told to be unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from sensor_msgs.msg import CameraInfo, PointCloud2

from perception_bench.broken_clouds import CLOUDS, CloudKind, SweepInTime
from perception_bench.broken_pictures import PICTURES, PairInTime, PictureKind
from perception_bench.cases import DATA, cloud_bytes
from perception_bench.recordings import Camera, Recording, Scanner, verdicts
from perception_bench.street import Drive, in_the_way, street, wood
from perception_core import NS, Ahead, FaultKind, Finding, HealthWatch, VehicleMotion, Verdict, broken
from perception_core.clouds import sweep_of_cloud
from uav_simulator import ros_messages
from uav_simulator.sensors.mounts import OPTICAL, ZED_LEFT, rotation_matrix
from uav_simulator.sensors.pose_track import Pose
from uav_simulator.sensors.stereo import StereoPair as StereoRenderer
from uav_simulator.vehicle.quaternion import from_yaw
from zed_depth import StereoPair, ZedSettings

NEAR_M, OFF_M, KNOWN_S = 6.0, 0.5, 1.0
WARM_UP, LONGEST = 10, 24  # good measurements before the kind begins, and broken ones, at 10 Hz
CONSEQUENT = 2  # measurements
SPEED_M_S, SWAY_M = 1.0, 0.3
PILLAR_M, HALF_PILLAR_M = 6.5, 0.3  # along the drive from its beginning
SPINNING_16 = tuple(np.linspace(15.0, -15.0, 16).tolist())
SPINNING_32 = tuple(np.linspace(10.0, -30.0, 32).tolist())
STANDS_M = 1.5  # above the ground, the camera of the standing vehicle


@dataclass(frozen=True)
class Told:
    """What one measurement tells: metres to the nearest obstacle, infinite without one, and whether a nearer one may be there."""

    nearest_m: float
    unknown: bool

    @classmethod
    def of(cls, ahead: Ahead, *, believed: bool) -> Told:
        """Return what is told of the way ahead by a sensor that is, or is not, ``believed``."""
        return cls(math.inf if ahead.nearest is None else ahead.nearest.distance_m, bool(ahead.unknown) or not believed)

    def misses(self, truth: Told, off_m: float) -> bool:
        """Return whether a near obstacle is not told, or told farther than it is by more than ``off_m``."""
        return truth.nearest_m < NEAR_M and self.nearest_m > truth.nearest_m + off_m and not self.unknown

    def invents(self, truth: Told, off_m: float) -> bool:
        """Return whether an obstacle is told nearer than one is by more than ``off_m``."""
        seen = truth.nearest_m < math.inf or not truth.unknown
        return seen and self.nearest_m < NEAR_M and self.nearest_m < truth.nearest_m - off_m


@dataclass(frozen=True)
class Window:
    """A moment in a recording at which a kind begins, and what the good measurements from it on tell."""

    name: str
    sensor: Camera | Scanner
    recording: Recording
    first: int
    good: tuple[Told, ...]


@dataclass(frozen=True)
class Met:
    """What a kind did in a window: seconds until it was known, if it was, and the words; measurements missed and invented until then."""

    window: str
    until_s: float | None
    reason: str
    missed: int
    invented: int

    @property
    def known(self) -> bool:
        """Whether it was known in time."""
        return self.until_s is not None and self.until_s <= KNOWN_S

    @property
    def consequence(self) -> bool:
        """Whether it was not known in time, and was believed with a consequence."""
        return not self.known and max(self.missed, self.invented) >= CONSEQUENT


Kind = PictureKind | CloudKind


def _run(window: Window, deliver: Callable[[int], tuple[Finding, Ahead]]) -> Met:
    """Run through a window; ``deliver`` gives a measurement by its number."""
    sensor, first = window.sensor, window.first
    sensor.restart()
    watch, stamps = HealthWatch(sensor.limits), sensor.stamps_ns
    error_per_m = ZedSettings().range_error_per_m if isinstance(sensor, Camera) else 0.0
    missed = invented = 0
    for number in range(first - WARM_UP, first + LONGEST):
        if number > first - WARM_UP:
            for count, verdict in enumerate(verdicts(watch, stamps[number - 1], stamps[number])):
                if number > first and verdict is not Verdict.OK:
                    until_s = (stamps[number - 1] - stamps[first - 1]) / NS + 0.02 * (count + 1)
                    return Met(window.name, until_s, watch.reason, missed, invented)
        finding, ahead = deliver(number)
        watch.take(finding, stamps[number])
        if number >= first:
            told, truth = Told.of(ahead, believed=finding.ok), window.good[number - first]
            off_m = OFF_M + error_per_m * min(truth.nearest_m, NEAR_M) ** 2
            missed += told.misses(truth, off_m)
            invented += told.invents(truth, off_m)
    return Met(window.name, None, "", missed, invented)


def _pictures(window: Window, kind: PictureKind) -> Met:
    camera, pairs = window.sensor, window.recording.pairs
    assert isinstance(camera, Camera)  # noqa: S101 -- for the type checker
    rng = np.random.default_rng(0)

    def deliver(number: int) -> tuple[Finding, Ahead]:
        good = pairs[number]
        if number < window.first:
            return camera.deliver(good, good.stamp_ns, look=True)
        if number == window.first:
            camera.inform(kind.infos(window.recording.infos))
        moment = PairInTime(pairs, number, window.first, rng)
        return camera.deliver(kind.pair(moment), good.stamp_ns, look=True)

    return _run(window, deliver)


def _clouds(window: Window, kind: CloudKind) -> Met:
    scanner, sweeps = window.sensor, window.recording.sweeps
    assert isinstance(scanner, Scanner)  # noqa: S101 -- for the type checker
    rng = np.random.default_rng(0)
    mount = window.recording.mounts["lidar"]

    def deliver(number: int) -> tuple[Finding, Ahead]:
        good = sweeps[number]
        if number < window.first:
            return scanner.deliver(good, good.end_ns, look=True)
        moment = SweepInTime(sweeps, number, window.first, rng, ahead=mount[0, :3], up=mount[2, :3])
        sweep = kind.sweep(moment)
        columns = np.column_stack([sweep.points, sweep.times_s]).astype(np.float32)
        try:
            read = sweep_of_cloud(PointCloud2().deserialize(cloud_bytes(columns, sweep.stamp_ns)))
        except ValueError as error:
            return broken(FaultKind.FORMAT, str(error)), Ahead(None, str(error))
        return scanner.deliver(read, good.end_ns, look=True, frame=kind.frame)

    return _run(window, deliver)


def _window(sensor: Camera | Scanner, recording: Recording, pillar_m: float | None = None) -> Window:
    """Return a window: what is true is known of a drive to a pillar at ``pillar_m`` along x, else what its good measurements tell."""
    first = WARM_UP + 1
    if pillar_m is not None:
        stamps_ns = sensor.stamps_ns[first : first + LONGEST]
        ways_m = [pillar_m - HALF_PILLAR_M - float(recording.poses.at([stamp_ns]).position[0, 0]) for stamp_ns in stamps_ns]
        return Window(recording.name, sensor, recording, first, tuple(Told(way_m, unknown=False) for way_m in ways_m))
    sensor.restart()
    good = []
    for number in range(first - WARM_UP, first + LONGEST):
        if isinstance(sensor, Camera):
            pair = recording.pairs[number]
            finding, ahead = sensor.deliver(pair, pair.stamp_ns, look=True)
        else:
            sweep = recording.sweeps[number]
            finding, ahead = sensor.deliver(sweep, sweep.end_ns, look=True)
        good.append(Told.of(ahead, believed=finding.ok))
    return Window(recording.name, sensor, recording, first, tuple(good[WARM_UP:]))


def _standing() -> Recording:
    """Return a real pair, Middlebury's Motorcycle, seen again and again with new noise by a vehicle that stands."""
    left, right = (
        cv2.imread(str(DATA / "stereo_motorcycle" / f"motorcycle_{side}.png"), cv2.IMREAD_GRAYSCALE) for side in ("left", "right")
    )
    recording, rng = Recording("Motorcycle, standing"), np.random.default_rng(3)
    height, width = left.shape
    fx, cx, cy, offset_px, baseline_m = 994.978, 311.193, 254.877, 31.086, 0.193001
    for side, centre, shift in (("left", cx, 0.0), ("right", cx + offset_px, -fx * baseline_m)):
        K = [fx, 0, centre, 0, fx, cy, 0, 0, 1]  # noqa: N806 -- the message's names
        P = [fx, 0, centre, shift, 0, fx, cy, 0, 0, 0, 1, 0]  # noqa: N806
        recording.infos[side] = CameraInfo(width=width, height=height, K=K, P=P, R=np.eye(3).ravel().tolist(), distortion_model="plumb_bob")
    mount = np.eye(4)
    mount[:3, :3] = rotation_matrix(OPTICAL)
    recording.mounts[ZED_LEFT.frame_id] = mount
    for number in range(WARM_UP + LONGEST + 5):
        stamp_ns = NS + number * NS // 10
        images = (np.clip(image + rng.normal(0.0, 1.5, image.shape), 0, 255).astype(np.uint8) for image in (left, right))
        recording.pairs.append(StereoPair(stamp_ns, *images))
        for tick in range(5):
            recording.poses.add(stamp_ns + tick * NS // 50, (0.0, 0.0, STANDS_M), (0.0, 0.0, 0.0, 1.0))
    return recording


def _driven(name: str, drive: Drive) -> Recording:
    """Return what is recorded of a slow drive, as long as a window, by a LiDAR in the middle of the vehicle and the drone's camera."""
    recording = Recording(name, mounts={"lidar": np.eye(4), ZED_LEFT.frame_id: np.eye(4)})
    recording.mounts[ZED_LEFT.frame_id][:3] = np.column_stack([ZED_LEFT.matrix, ZED_LEFT.translation])
    stereo = StereoRenderer(drive.scene, drive.seed)
    recording.infos = {side: ros_messages.camera_info(stereo.camera, right=side == "right", stamp_ns=0) for side in ("left", "right")}
    for tick in range(-10, 5 * (WARM_UP + LONGEST + 6)):
        pose, stamp_ns = drive.pose(tick / 50), NS + tick * NS // 50
        half_yaw = math.atan2(pose[1, 0], pose[0, 0]) / 2
        x, y, z = (float(value) for value in pose[:3, 3])
        recording.poses.add(stamp_ns, (x, y, z), (0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw)))
        velocity = SPEED_M_S * pose[:3, 0]
        recording.motions.append((stamp_ns, VehicleMotion((float(velocity[0]), float(velocity[1]), 0.0))))
    for number in range(1, WARM_UP + LONGEST + 3):
        recording.sweeps.append(drive.sweep(number))
        pose = drive.pose(number / 10)
        yaw = math.atan2(pose[1, 0], pose[0, 0])
        place = (float(pose[0, 3]), float(pose[1, 3]), float(pose[2, 3]))
        recording.pairs.append(StereoPair(NS + number * NS // 10, *stereo.render(Pose(1.0 + number / 10, place, from_yaw(yaw)))))
    return recording


def windows(what: str) -> Iterator[Window]:
    """Yield three windows for ``pictures`` or ``clouds``: slow drives along streets and through a wood towards a pillar.

    For pictures one is a real pair instead, where it is at hand. What is told nearer than the pillar is invented.
    """
    slow, pillar = partial(Drive, speed_m_s=SPEED_M_S, sway_m=SWAY_M), in_the_way(PILLAR_M)
    drives = {
        "street, 64 rings": slow(street(30.0, 5, pillar), 5),
        "wood, 32 rings": slow(wood(30.0, 7, pillar), 7, rings_deg=SPINNING_32, columns=1024),
        "street, 16 rings": slow(street(30.0, 6, pillar), 6, rings_deg=SPINNING_16, columns=1800),
    }
    real = what == "pictures" and (DATA / "stereo_motorcycle").exists()
    for name, drive in list(drives.items())[: 2 if real else 3]:
        recording = _driven(name, drive)
        yield _window(Camera(recording) if what == "pictures" else Scanner(recording), recording, PILLAR_M)
    if real:
        recording = _standing()
        yield _window(Camera(recording), recording)


@dataclass(frozen=True)
class Result:
    """What became of one kind in all windows."""

    kind: Kind
    met: tuple[Met, ...]

    @property
    def seen(self) -> str:
        """In how many windows it was known in time: all, some or none."""
        known = sum(each.known for each in self.met)
        return "all" if known == len(self.met) else "some" if known else "none"

    @property
    def consequence(self) -> bool:
        """Whether it was missed with a consequence in one window at least."""
        return any(each.consequence for each in self.met)

    @property
    def told_rightly(self) -> bool | None:
        """Whether most of its findings name its cause; None without a finding."""
        told = [any(cause in each.reason for cause in self.kind.causes) for each in self.met if each.until_s is not None]
        return None if not told else 2 * sum(told) > len(told)

    def row(self) -> dict[str, object]:
        """Return what is written to a file."""
        met = [vars(each) | {"known": each.known, "consequence": each.consequence} for each in self.met]
        return {
            "kind": self.kind.name,
            "parameter": self.kind.parameter,
            "seen": self.seen,
            "consequence": self.consequence,
            "told_rightly": self.told_rightly,
            "met": met,
        }


def results(what: str, only: str = "") -> Iterator[Result]:
    """Yield what became of each kind of ``pictures`` or ``clouds``, or of those whose names begin with ``only``."""
    chosen = list(windows(what))
    kinds: Sequence[Kind] = PICTURES if what == "pictures" else CLOUDS
    for kind in kinds:
        if kind.name.startswith(only):
            run = partial(_pictures, kind=kind) if isinstance(kind, PictureKind) else partial(_clouds, kind=kind)
            yield Result(kind, tuple(run(window) for window in chosen))


def line(result: Result) -> str:
    """Return a result in a line, and the worst windows of it below."""
    cause = {None: "-", True: "right", False: "WRONG"}[result.told_rightly]
    named = f"{result.kind.name}, {result.kind.parameter}" if result.kind.parameter else result.kind.name
    lines = [f"{named:48} known in {result.seen:5} cause {cause:6}{' CONSEQUENCE' if result.consequence else ''}"]
    for each in result.met:
        until = "never" if each.until_s is None else f"{each.until_s:.2f} s"
        if each.consequence or not each.known or result.told_rightly is False:
            lines.append(f"    {each.window}: {until}; missed {each.missed}, invented {each.invented}; {each.reason}")
    return "\n".join(lines)


def summed_up(what: str, found: Sequence[Result]) -> str:
    """Return the figures of all kinds in a line."""
    seen = {word: sum(each.seen == word for each in found) for word in ("all", "some", "none")}
    told = [each.told_rightly for each in found if each.told_rightly is not None]
    return (
        f"{what}: {len(found)} kinds; known within {KNOWN_S:g} s in all {seen['all']}, in some {seen['some']}, in none {seen['none']}; "
        f"missed with a consequence {sum(each.consequence for each in found)}; cause right {sum(told)} of {len(told)}"
    )
