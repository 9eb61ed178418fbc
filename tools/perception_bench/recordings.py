"""What the nodes say of a recorded flight, and of the same flight with a sensor that breaks: ``./alula bench perception --recording BAG``.

The bag is a run's ``functional.bag`` with raw measurements (``--record sensors``). The cores of the nodes judge its measurements; a
sensor breaks as the simulator breaks it.
"""

from __future__ import annotations

import bisect
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
import rosbag
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo

from lidar_obstacles import LidarSettings
from lidar_obstacles.core import LidarObstacles
from perception_core import NS, Ahead, Finding, HealthLimits, HealthWatch, PoseBuffer, Sweep, VehicleMotion, Verdict
from perception_core.clouds import sweep_of_cloud
from perception_core.conversions import matrix_of_transform
from perception_core.images import GrayConverter
from perception_core.vehicle import BASE, KnownVehicle
from uav_simulator.sensors import degradation
from uav_simulator.sensors.faults import FAULTS, SensorMode
from uav_simulator.sensors.lidar import POINT_DTYPE
from zed_depth import Pairing, StereoPair, ZedSettings
from zed_depth.core import ZedDepth

Floats = NDArray[np.float64]
WORDS = ("free", "unknown", "obstacle")
TICK_NS = NS // 50
WARM_UP = 6  # good measurements before a fault, and up to three more, so that it falls anywhere between two checks
LONGEST = 12  # broken measurements until the verdict
SHIFTED_NS = {SensorMode.LATE: -degradation.LATE_NS, SensorMode.FUTURE: degradation.FUTURE_NS}
NOT_LOOKED = "nobody looked"
REPEATED = (SensorMode.FROZEN, SensorMode.FLICKERING)


@dataclass
class Recording:
    """What was recorded of a flight, in the order of arrival."""

    name: str
    poses: PoseBuffer = field(default_factory=lambda: PoseBuffer(keep_s=1e6))
    motions: list[tuple[int, VehicleMotion]] = field(default_factory=list)
    mounts: dict[str, Floats] = field(default_factory=dict)
    infos: dict[str, CameraInfo] = field(default_factory=dict)
    pairs: list[StereoPair] = field(default_factory=list)
    sweeps: list[Sweep] = field(default_factory=list)

    def motion(self, stamp_ns: int) -> VehicleMotion:
        """Return what the guidance had last said at a moment."""
        at = bisect.bisect(self.motions, stamp_ns, key=lambda known: known[0])
        return self.motions[at - 1][1] if at else VehicleMotion()


def read(path: Path) -> Recording:
    """Read a bag; a flight without cameras or without a LiDAR has no pairs or no sweeps."""
    recording, gray, pairing = Recording(path.parent.name), GrayConverter(), Pairing(tolerance_s=ZedSettings().sync_tolerance_s)
    topics = ["/uav_guidance/pose", "/uav_guidance/state", "/tf_static", "/lidar/points"]
    topics += [f"/zed/{side}/{what}" for side in ("left", "right") for what in ("camera_info", "image_raw")]
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _ in bag.read_messages(topics=topics):
            side = "left" if "/left/" in topic else "right"
            if topic.endswith("/pose"):
                p, q = message.pose.position, message.pose.orientation
                recording.poses.add(message.header.stamp.to_nsec(), (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
            elif topic.endswith("/state"):
                v, t = message.velocity_enu_m_s, message.target_enu_m
                target = (t.x, t.y, t.z) if message.reference == "position" else None
                recording.motions.append((message.header.stamp.to_nsec(), VehicleMotion((v.x, v.y, v.z), target)))
            elif topic == "/tf_static":
                recording.mounts |= {each.child_frame_id.lstrip("/"): matrix_of_transform(each.transform) for each in message.transforms}
            elif topic.endswith("camera_info"):
                recording.infos[side] = message
            elif topic.endswith("image_raw"):
                pair = pairing.add(side, message.header.stamp.to_nsec(), gray.gray(message).copy())
                recording.pairs += [pair] if pair is not None else []
            else:
                recording.sweeps.append(sweep_of_cloud(message))
    return recording


class Sensor(Protocol):
    """One of the two, on one recording."""

    name: str
    limits: HealthLimits
    stamps_ns: list[int]

    def restart(self) -> None:
        """Begin as a node does."""

    def take(self, k: int, mode: SensorMode, last_good: int, *, look: bool) -> tuple[Finding, str]:
        """Return the finding of measurement ``k``, broken since ``last_good``, and what of `WORDS` it says, if it is to ``look``."""


class RecordingHost:
    """Runs a core of which single steps are called: it knows when the measurement at hand has arrived, and takes nothing."""

    def __init__(self) -> None:
        self.arrived_ns = 0

    def now_ns(self) -> int:
        """Return when the measurement arrived."""
        return self.arrived_ns

    def publish(self, topic: str, message: object) -> None:
        """Take nothing."""

    def wanted(self, _topic: str) -> bool:
        """Return that nobody takes it."""
        return False

    def published(self, _topic: str) -> bool:
        """Return that the recording publishes it."""
        return True

    def done(self, stamp_ns: int) -> None:
        """Wait for nobody."""

    def report(self, resource: str, state: str, reason: str = "", *, insist: bool = True) -> None:
        """Take nothing."""

    def offer(self, work: Callable[[], None]) -> None:
        """Take nothing."""

    def info(self, text: str) -> None:
        """Take nothing."""

    def warn(self, about: str, text: str, *, every_s: float = 2.0) -> None:
        """Take nothing."""


def _know(vehicle: KnownVehicle, recording: Recording) -> None:
    vehicle.poses = recording.poses
    for frame, mount in recording.mounts.items():
        vehicle.set_mount(BASE, frame, mount)


class Camera:
    """The core of /zed_depth, fed with a recording's image pairs."""

    def __init__(self, recording: Recording) -> None:
        self.name, self._recording, self._settings = "zed", recording, ZedSettings()
        self.limits, self.stamps_ns = self._settings.health, [pair.stamp_ns for pair in recording.pairs]
        self.restart()

    def restart(self) -> None:
        """Begin as a node does."""
        self._host = RecordingHost()
        self._core = ZedDepth(self._settings, self._host)
        self._core.frame = "zed_left"
        _know(self._core.vehicle, self._recording)
        self._rng = np.random.default_rng(0)
        self._info(1)

    def inform(self, infos: dict[str, CameraInfo]) -> None:
        """Tell other camera_infos."""
        for side, info in infos.items():
            self._core.take_info(side, info)

    def _info(self, scale: int) -> None:
        for side, info in self._recording.infos.items():
            matrices = {name: [value * scale for value in getattr(info, name)] for name in ("K", "P")}
            P = [*matrices["P"][:10], 1.0, 0.0]  # noqa: N806 -- the message's name
            told = CameraInfo(height=info.height * scale, width=info.width * scale, D=info.D, K=[*matrices["K"][:8], 1.0], R=info.R, P=P)
            told.distortion_model = info.distortion_model
            self._core.take_info(side, told)

    def take(self, k: int, mode: SensorMode, last_good: int, *, look: bool) -> tuple[Finding, str]:
        """Return the finding of a pair, and what it says."""
        recording = self._recording
        given, shown = recording.pairs[k], recording.pairs[last_good if mode in REPEATED else k]
        left, right = degradation.pair(mode, (shown.left, shown.right), self._rng)
        pair = StereoPair(given.stamp_ns + SHIFTED_NS.get(mode, 0), left, right)
        if mode is SensorMode.WRONG_INFO and k == last_good + 1:
            self._info(2)
        finding, ahead = self.deliver(pair, given.stamp_ns, look=look)
        return finding, _word(ahead)

    def deliver(self, pair: StereoPair, arrived_ns: int, *, look: bool) -> tuple[Finding, Ahead]:
        """Return the finding of a pair that arrives at a moment, and what is told of it to be ahead, if it is to ``look``."""
        core = self._core
        self._host.arrived_ns, core.vehicle.motion = arrived_ns, self._recording.motion(pair.stamp_ns)
        finding = core.finding(pair)
        if not finding.ok or not look:
            return finding, Ahead(None, finding.reason or NOT_LOOKED)
        return finding, _told_ahead(lambda: core.ahead(core.depth(pair), pair.stamp_ns))


class Scanner:
    """The core of /lidar_obstacles, fed with a recording's sweeps."""

    def __init__(self, recording: Recording) -> None:
        self.name, self._recording, self._settings = "lidar", recording, LidarSettings()
        self.limits, self.stamps_ns = self._settings.health, [sweep.end_ns for sweep in recording.sweeps]
        self.restart()

    def restart(self) -> None:
        """Begin as a node does."""
        self._host = RecordingHost()
        self._core = LidarObstacles(self._settings, self._host)
        _know(self._core.vehicle, self._recording)
        self._rng = np.random.default_rng(0)

    def take(self, k: int, mode: SensorMode, last_good: int, *, look: bool) -> tuple[Finding, str]:
        """Return the finding of a sweep, and what it says."""
        recording, given = self._recording, self._recording.sweeps[k]
        sweep = _broken_sweep(mode, recording.sweeps[last_good if mode in REPEATED else k], self._rng)
        sweep = replace(sweep, stamp_ns=given.stamp_ns + SHIFTED_NS.get(mode, 0))
        finding, ahead = self.deliver(sweep, given.end_ns, look=look)
        return finding, _word(ahead)

    def deliver(self, sweep: Sweep, arrived_ns: int, *, look: bool, frame: str = "lidar") -> tuple[Finding, Ahead]:
        """Return the finding of a sweep that arrives at a moment, and what is told of it to be ahead, if it is to ``look``."""
        core = self._core
        self._host.arrived_ns, core.vehicle.motion = arrived_ns, self._recording.motion(sweep.end_ns)
        judged = core.judged(sweep, frame)
        if not judged.finding.ok or not look:
            return judged.finding, Ahead(None, judged.finding.reason or NOT_LOOKED)
        return judged.finding, _told_ahead(lambda: core.ahead(judged, frame))


def _told_ahead(look: Callable[[], Ahead]) -> Ahead:
    try:
        return look()
    except LookupError as error:
        return Ahead(None, str(error))


def _word(ahead: Ahead) -> str:
    return "obstacle" if ahead.nearest is not None else "unknown" if ahead.unknown else "free"


def _broken_sweep(mode: SensorMode, sweep: Sweep, rng: np.random.Generator) -> Sweep:
    points = np.zeros(len(sweep.points), dtype=POINT_DTYPE)
    points["x"], points["y"], points["z"] = sweep.points.T
    points["time"] = sweep.times_s
    broken = degradation.sweep(mode, points, rng)
    return Sweep(sweep.stamp_ns, np.column_stack([broken[axis] for axis in "xyz"]), broken["time"].copy())


@dataclass
class Good:
    """What a sensor was told to be on a good recording: alarms are changes of the verdict to BROKEN or back to UNKNOWN."""

    minutes: float
    measurements: int
    alarms: int = 0
    reasons: Counter[str] = field(default_factory=Counter)  # of findings that are not OK, each of which alone is no alarm
    words: list[str] = field(default_factory=list)


def on_good(sensor: Sensor) -> Good:
    """Run through a good recording."""
    sensor.restart()
    stamps = sensor.stamps_ns
    result = Good((stamps[-1] - stamps[0]) / NS / 60.0, len(stamps))
    watch, before, known = HealthWatch(sensor.limits), stamps[0], False
    for k, stamp_ns in enumerate(stamps):
        for verdict in verdicts(watch, before, stamp_ns):
            known |= verdict is Verdict.OK
            result.alarms += known and verdict is not Verdict.OK
            known &= verdict is Verdict.OK
        finding, word = sensor.take(k, SensorMode.OK, k, look=True)
        watch.take(finding, stamp_ns)
        result.reasons[f"{finding.fault.value}: {finding.reason}"] += not finding.ok
        result.words.append(word)
        before = stamp_ns
    return result


def verdicts(watch: HealthWatch, from_ns: int, to_ns: int) -> Iterator[Verdict]:
    """Yield the verdicts between two measurements."""
    for now_ns in range(from_ns + TICK_NS, to_ns + 1, TICK_NS):
        yield watch.tick(now_ns)


@dataclass
class Broken:
    """What a fault made of a sensor: seconds until it was not believed, and its words before, by what the good sensor said there."""

    until_s: list[float] = field(default_factory=list)
    missed: int = 0
    words: Counter[tuple[str, str]] = field(default_factory=Counter)


def on_broken(sensor: Sensor, good: Good, mode: SensorMode, times: int) -> Broken:
    """Break a sensor at so many moments at which an obstacle is ahead, and at as many at which none is."""
    result = Broken()
    for truth in ("obstacle", "free"):
        last = len(sensor.stamps_ns) - LONGEST
        moments = [k for k in range(WARM_UP + 4, last) if good.words[k] == truth == good.words[k + 2]]
        chosen = moments[:: max(1, len(moments) // times)][:times]
        for number, first in enumerate(chosen):
            _break(sensor, good, mode, first, WARM_UP + number % 4, result)
    return result


def _break(sensor: Sensor, good: Good, mode: SensorMode, first: int, warm_up: int, result: Broken) -> None:
    sensor.restart()
    watch, stamps = HealthWatch(sensor.limits), sensor.stamps_ns
    for k in range(first - warm_up, first):
        finding, _ = sensor.take(k, SensorMode.OK, k, look=k >= first - 2)
        watch.take(finding, stamps[k])
    for k in range(first, first + LONGEST):
        for number, verdict in enumerate(verdicts(watch, stamps[k - 1], stamps[k])):
            if verdict is not Verdict.OK and k > first:
                result.until_s.append((stamps[k - 1] + (number + 1) * TICK_NS - stamps[first - 1]) / NS)
                return
        if mode is not SensorMode.DEAD:
            finding, word = sensor.take(k, mode, first - 1, look=True)
            watch.take(finding, stamps[k])
            result.words[good.words[k], word] += 1
    result.missed += 1


def faults_of(sensor: Sensor) -> list[SensorMode]:
    """Return the ways in which the simulator breaks a sensor."""
    return [SensorMode(mode) for mode in FAULTS[sensor.name]]


def judged(recording: Recording, times: int) -> Iterator[dict[str, object]]:
    """Return a row for each sensor of a recording, and one for each fault of a sensor that broke so many times; see ``told``."""
    for sensor, count in ((Camera(recording), len(recording.pairs)), (Scanner(recording), len(recording.sweeps))):
        if not count:
            continue
        good = on_good(sensor)
        yield {
            "recording": recording.name,
            "sensor": sensor.name,
            "minutes": good.minutes,
            "measurements": good.measurements,
            "false_alarms": good.alarms,
            "not_ok": sum(good.reasons.values()),
            **{word: good.words.count(word) for word in WORDS},
        }
        for mode in faults_of(sensor) if times else ():
            broken = on_broken(sensor, good, mode, times)
            row: dict[str, object] = {"sensor": sensor.name, "fault": mode.value, "found": len(broken.until_s), "missed": broken.missed}
            row["longest_s"] = max(broken.until_s, default=0.0)
            row |= {f"{truth}_told_{word}": broken.words[truth, word] for truth in ("obstacle", "free") for word in WORDS}
            yield row


def told(row: dict[str, object]) -> str:
    """Return a row in words."""
    if "fault" not in row:
        words = ", ".join(f"{word} {row[word]}" for word in WORDS)
        found = f"{row['false_alarms']} false alarms, {row['not_ok']} findings that are not OK"
        return f"{row['recording']}, {row['sensor']}: {row['minutes']:.1f} minutes, {row['measurements']} measurements, {found}; {words}"
    until = f"found {row['found']} times after {row['longest_s']:.2f} s at most, missed {row['missed']} times; told until then"
    words = "; ".join(f"{truth}: " + ", ".join(f"{word} {row[f'{truth}_told_{word}']}" for word in WORDS) for truth in ("obstacle", "free"))
    return f"    {row['fault']:11} {until}, where it truly was {words}"
