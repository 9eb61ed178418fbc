"""What is measured: messages as drivers send them, the nodes' way through them, and the bare library's; and the accuracy on real data."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

from lidar_mapping import Slam, SlamSettings
from lidar_obstacles import CloudJudge, LidarAhead, LidarSettings, MountCheck
from perception_core import NS, PoseBuffer, Sweep, TurnJoiner, VehicleMotion
from perception_core.clouds import sweep_of_cloud
from perception_core.images import GrayConverter
from perception_core.testing import wall_pair
from zed_depth import DisparityRange, MatcherSettings, StereoMatcher, StereoPair, StereoRig, ZedSettings, confidence_of, look_ahead

Gray = NDArray[np.uint8]
Work = Callable[[], object]
DATA = Path(os.environ.get("ALULA_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
FORWARD = VehicleMotion(velocity_enu_m_s=(1.0, 0.0, 0.0))
OPTICAL = np.array([[0.0, 0, 1, 0.3], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
BASELINE_M = 0.12


@dataclass(frozen=True)
class Case:
    """One input; ``make`` returns what is to be timed by name, ``node`` first."""

    name: str
    make: Callable[[], dict[str, Work]]


def poses() -> PoseBuffer:
    """Return a vehicle that hovers at 2 m around the moment 1 s."""
    buffer = PoseBuffer()
    for k in range(20):
        buffer.add(NS + k * NS // 50, (0.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.0))
    return buffer


def bare_matcher(count: int) -> cv2.StereoSGBM:
    """Return OpenCV's matcher with the node's parameters."""
    given = MatcherSettings()
    area = given.block_px**2
    mode = cv2.STEREO_SGBM_MODE_SGBM_3WAY
    return cv2.StereoSGBM_create(
        0, count, given.block_px, 8 * area, 32 * area, given.left_right_px, 31, given.uniqueness_percent, given.speckle_px, 2, mode
    )


def stereo(width: int, height: int, fx: float) -> dict[str, Work]:
    """Measure /zed_depth on raw bytes of both images; view checks come at their period as in flight, at 10 Hz."""
    cv2.setNumThreads(ZedSettings().threads)
    left, right = (cv2.resize(image, (width, height)) for image in wall_pair(8.0, seed=1))
    rng = np.random.default_rng(0)
    noise = [rng.integers(-2, 3, left.shape) for _ in range(4)]
    pairs = [[np.clip(image + grain, 0, 255).astype(np.uint8) for image in (left, right)] for grain in noise]
    messages = [[_bytes(_image(image)) for image in pair] for pair in pairs]
    rig, gray, settings, known = StereoRig(ZedSettings()), GrayConverter(), ZedSettings(), poses()
    for side, shift in (("left", 0.0), ("right", -fx * BASELINE_M)):
        P = [fx, 0, width / 2, shift, 0, fx, height / 2, 0, 0, 0, 1, 0]  # noqa: N806 -- the message's name
        rig.take_info(side, CameraInfo(width=width, height=height, P=P))
    frame = [0]

    def node() -> None:
        frame[0] += 1
        images = [gray.gray(Image().deserialize(data)) for data in messages[frame[0] % 4]]
        pair = StereoPair(frame[0] * NS // 10, images[0], images[1])
        rig.finding(pair)
        depth = rig.depth(pair)
        look_ahead(depth.metres, NS, geometry=depth.geometry, T_base_camera=OPTICAL, poses=known, motion=FORWARD, settings=settings.ahead)

    divisor = max(1, round(width / settings.max_width_px))
    small = [cv2.resize(image, (width // divisor, height // divisor), interpolation=cv2.INTER_AREA) for image in (left, right)]
    count = 16 * int(np.ceil((fx / divisor * BASELINE_M / ZedSettings().near_depth_m + 1) / 16))
    ours, bare = StereoMatcher(MatcherSettings(), DisparityRange(0, count)), bare_matcher(count)
    wide = [cv2.copyMakeBorder(image, 0, 0, count, 0, cv2.BORDER_REPLICATE) for image in small]
    return {
        "node": node,
        "its matching alone": lambda: ours.disparity(small[0], small[1]),
        "bare StereoSGBM": lambda: bare.compute(*small),
        "bare, all columns": lambda: bare.compute(*wide),
    }


def _image(pixels: Gray) -> Image:
    height, width = pixels.shape
    return Image(header=Header(), height=height, width=width, encoding="mono8", step=width, data=pixels.tobytes())


def _bytes(message: Image | PointCloud2) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def yard_sweep(count: int, seed: int) -> NDArray[np.float32]:
    """Return (N, 3) returns of ground that rises by 4 degrees ahead, of walls at 15 m and of a box at 6 m, from 2 m above."""
    rng = np.random.default_rng(seed)
    azimuth, ranges = rng.uniform(-np.pi, np.pi, count), 2.0 + 28.0 * rng.random(count) ** 2
    ground = np.column_stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), np.zeros(count)])
    ground[:, 2] = -2.0 + np.tan(np.radians(4.0)) * np.maximum(ground[:, 0], 0.0) + rng.normal(0, 0.02, count)
    walls = np.abs(ground[:, 1]) > 15.0
    ground[walls, 2] = rng.uniform(-2.0, 4.0, int(walls.sum()))
    ground[: count // 100] = np.array([6.0, 0.0, 0.0]) + rng.uniform(-0.4, 0.4, (count // 100, 3))
    return ground.astype(np.float32)


def lidar(count: int) -> dict[str, Work]:
    """Measure /lidar_obstacles on the bytes of clouds with times, against numpy's bare reading of them."""
    columns = [yard_sweep(count, seed) for seed in range(4)]
    times = np.linspace(0.0, 0.1, count, dtype=np.float32)
    return _lidar([cloud_bytes(np.column_stack([points, times])) for points in columns])


def kitti() -> dict[str, Work]:
    """Measure /lidar_obstacles on real scans of 64 beams."""
    scans = [np.fromfile(path, np.float32).reshape(-1, 4) for path in sorted((DATA / "lidar_kitti").glob("*.bin"))]
    return _lidar([cloud_bytes(np.column_stack([scan[:, :3], np.linspace(0.0, 0.1, len(scan), dtype=np.float32)])) for scan in scans])


def mapping() -> dict[str, Work]:
    """Measure /lidar_mapping on real scans of 64 beams, 0.8 m apart, there and back; each time it has come back it begins anew.

    The autopilot drifts by 5 % and there is no IMU.
    """
    scans = [np.fromfile(path, np.float32).reshape(-1, 4)[:, :3] for path in sorted((DATA / "lidar_kitti").glob("*.bin"))]
    places = np.loadtxt(DATA / "lidar_kitti" / "T_first_scan.txt").reshape(-1, 3, 4)[:, :, 3]
    messages = [cloud_bytes(np.column_stack([scan, np.full(len(scan), 0.1, dtype=np.float32)])) for scan in scans]
    settings, lap = SlamSettings(self_m=2.5, max_range_m=80.0), [0, 1, 2, 1]
    slam, frame = [Slam(settings)], [-1]

    def node() -> None:
        frame[0] += 1
        turn = frame[0] % len(lap)
        if not turn:
            slam[0] = Slam(settings)
        sweep = sweep_of_cloud(PointCloud2().deserialize(messages[lap[turn]]))
        known = PoseBuffer()
        for k, place in ((0, places[lap[turn - 1]] if turn else places[0]), (1, places[lap[turn]])):
            known.add(NS + (turn + k) * NS // 10, tuple(1.05 * place), (0.0, 0.0, 0.0, 1.0))
        slam[0].add(Sweep(NS + turn * NS // 10, sweep.points, sweep.times_s), [], known, np.eye(4))

    return {"node": node, **{name: work for name, work in _lidar(messages).items() if name != "node"}}


def street_mapping() -> dict[str, Work]:
    """Measure /lidar_mapping's way of a sweep on a drive of 48 m along a street, 127,000 points a sweep; each drive begins anew."""
    from perception_bench.street import Drive, street  # late: the simulator would count as memory of the other cases

    drive, settings, frame = Drive(street(50.0, 1), 1), SlamSettings(self_m=1.5, max_range_m=80.0), [-1]
    sweeps = [(drive.sweep(number), drive.poses(number, 0.02)) for number in range(1, 61)]
    slam = [Slam(settings)]

    def node() -> None:
        frame[0] += 1
        turn = frame[0] % len(sweeps)
        if not turn:
            slam[0] = Slam(settings)
        slam[0].add(sweeps[turn][0], [], sweeps[turn][1], np.eye(4))

    return {"node": node}


def _lidar(messages: list[bytes]) -> dict[str, Work]:
    settings, known = LidarSettings(), poses()
    judge, ahead = CloudJudge(settings.cloud), LidarAhead(settings.ahead)
    turns, mounting = TurnJoiner(), MountCheck()
    frame = [0]

    def node() -> None:
        frame[0] += 1
        sweep = turns.joined(sweep_of_cloud(PointCloud2().deserialize(messages[frame[0] % len(messages)])))
        judge.finding(sweep, self_m=settings.body_radius_m)
        mounting.finding(sweep, np.eye(4), known, self_m=settings.body_radius_m)
        ahead.look(sweep, T_base_lidar=np.eye(4), poses=known, motion=FORWARD)

    def bare() -> None:
        message = PointCloud2().deserialize(messages[frame[0] % len(messages)])
        np.frombuffer(message.data, np.float32).reshape(-1, 4)[:, :3].astype(np.float64)

    return {"node": node, "bare reading": bare}


def cloud_bytes(columns: NDArray[np.float32], stamp_ns: int = NS) -> bytes:
    """Return the bytes of a cloud of x, y, z and time (N, 4)."""
    fields = [PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1) for k, name in enumerate(("x", "y", "z", "time"))]
    data = np.ascontiguousarray(columns, "<f4").tobytes()
    message = PointCloud2(height=1, width=len(columns), fields=fields, point_step=16, row_step=16 * len(columns), data=data, is_dense=True)
    message.header.stamp.secs, message.header.stamp.nsecs = divmod(stamp_ns, NS)
    return _bytes(message)


CASES = [
    Case("stereo 480x270, 64 disparities", partial(stereo, 480, 270, 240.0)),
    Case("stereo 1280x720, matched at half", partial(stereo, 1280, 720, 700.0)),
    Case("lidar 30,000 points", partial(lidar, 30_000)),
    Case("lidar 120,000 points", partial(lidar, 120_000)),
    Case("street, mapping of 127,000 points", street_mapping),
]
if (DATA / "lidar_kitti").exists():
    CASES.append(Case("lidar, real scans of 124,000", kitti))
    CASES.append(Case("mapping, real scans of 124,000", mapping))


def accuracy() -> list[dict[str, str]]:
    """Return how right the results are on real data with known truth, line by line; where it is not at hand, a line that says so."""
    folder = DATA / "stereo_motorcycle"
    if not folder.exists():
        return [{"what": "accuracy", "figure": f"no real data at {DATA}: set ALULA_DATA"}]
    left, right = (cv2.imread(str(folder / f"motorcycle_{side}.png"), cv2.IMREAD_GRAYSCALE) for side in ("left", "right"))
    truth = np.load(folder / "motorcycle_disp.npz")["arr_0"]
    ours = StereoMatcher(MatcherSettings(), DisparityRange(0, 80)).disparity(left, right)
    sixteenths = bare_matcher(80).compute(left, right)
    bare = np.where(sixteenths > 0, sixteenths / np.float32(16.0), np.nan)
    confidence = confidence_of(ours, left, right)
    sure = np.where(confidence >= np.median(confidence[np.isfinite(ours)]), ours, np.nan)
    known = np.isfinite(truth)
    least = np.sort(confidence[known])[::-1][np.count_nonzero(known & np.isfinite(bare))]
    as_many = np.where(confidence >= least, ours, np.nan)
    named = {"zed_depth": ours, "bare StereoSGBM": bare, "zed_depth, as many": as_many, "zed_depth, the surer half": sure}
    return [{"what": f"Motorcycle, {name}", "figure": _against(found, truth)} for name, found in named.items()]


def _against(found: NDArray[np.float32], truth: NDArray[np.float32]) -> str:
    known = np.isfinite(truth)
    both = known & np.isfinite(found)
    bad = float(np.mean(np.abs(found - truth)[both] > 2.0))
    return f"{both.sum() / known.sum():.1%} of the known pixels have a disparity, {bad:.1%} of these are off by more than 2 px"
