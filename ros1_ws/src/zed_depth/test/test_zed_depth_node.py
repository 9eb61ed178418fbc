"""/zed_depth on a live graph with its neighbours faked; the clock is the test's."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import SetBool
from uav_msgs.msg import Obstacle, SensorHealth

from alula_testing.waits import HANGS_S, until
from perception_core import NS
from perception_core.clouds import sweep_of_cloud
from perception_core.testing import Expected, FakeFlight, check_fault, wall_pair
from uav_simulator.sensors import degradation
from uav_simulator.sensors.faults import SensorMode

SIMULATED = ("flickering", "dark", "white", "blurred", "shifted", "rotated", "swapped")
"""Faults that are made as the simulator makes them."""
NODE = str(Path(__file__).parents[1] / "scripts" / "zed_depth_node")
CAMERA_X_M = 0.3
WALLS = 20


@cache
def wall(disparity_px: float, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return one of the pairs that a flight shows by turns, each with a noise of its own: made once for all tests.

    At each distance it is another wall: were it the same one, of which the left image stays as it is, the cameras would have been turned.
    """
    return wall_pair(disparity_px, seed=number, wall=round(10 * disparity_px))


class Camera:
    """What the faked camera shows: ``good`` or broken in a way; a wall at a disparity."""

    def __init__(self, flight: FakeFlight, disparity_px: float = 8.0) -> None:
        self.flight, self.disparity_px, self.mode, self.encoding = flight, disparity_px, "good", "mono8"
        self.last_good_ns = 0
        flight.at_10_hz = self

    def __call__(self, stamp_ns: int) -> None:
        if self.mode == "dead":
            return
        if self.mode == "good":
            self.last_good_ns = stamp_ns
        left, right = self._wall(stamp_ns)
        frozen = self._wall(self.last_good_ns)
        pairs = {"black": (left * 0, right * 0), "frozen": frozen}
        if self.mode in SIMULATED:
            rng = np.random.default_rng(stamp_ns // 1000 % 2**31)
            pairs[self.mode] = degradation.pair(SensorMode(self.mode), frozen if self.mode == "flickering" else (left, right), rng)
        scale = 2 if self.mode == "wrong info" else 1
        for side, image in zip(("left", "right"), pairs.get(self.mode, (left, right)), strict=True):
            pixels = np.dstack([image] * 3) if self.encoding == "bgr8" else image
            late_ns = {"future": -10 * NS, "late": NS}.get(self.mode, 0)
            if self.mode == "cut short":
                self.flight.publish_cut_image(side, stamp_ns, image)
                continue
            encoding = "jpeg" if self.mode == "encoding" else self.encoding
            self.flight.publish_image(side, stamp_ns - late_ns, pixels, encoding=encoding, info_scale=scale)

    def _wall(self, stamp_ns: int) -> tuple[np.ndarray, np.ndarray]:
        return wall(self.disparity_px, stamp_ns * 10 // NS % WALLS)


@pytest.fixture
def flight(ros_master, start_node):
    with FakeFlight("zed_depth") as fake:
        start_node([NODE, "_enabled:=false"])
        until(fake.connected, what="/zed_depth is up")
        rospy.wait_for_service("/zed_depth/enable", timeout=HANGS_S)
        yield fake


@pytest.fixture
def obstacles():
    seen: list[Obstacle] = []
    subscriber = rospy.Subscriber("/zed_depth/obstacle", Obstacle, seen.append)
    yield seen
    subscriber.unregister()


def enable(*, on: bool) -> None:
    assert rospy.ServiceProxy("/zed_depth/enable", SetBool)(on).success


def test_distance_of_a_wall_while_enabled_and_silence_otherwise(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    camera = Camera(flight, disparity_px=8.0)
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    assert not obstacles
    enable(on=True)
    enabled_ns = flight.now_ns
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    first = obstacles[0]
    assert first.header.stamp.to_nsec() - enabled_ns <= 0.2 * NS
    assert first.header.frame_id == "odom"
    assert first.source == "zed"
    assert first.detected
    expected_m = CAMERA_X_M + 240.0 * 0.12 / 8.0
    assert abs(first.distance_m - expected_m) < 0.2
    assert abs(first.nearest_enu_m.x - expected_m) < 0.3
    camera.disparity_px = 2.5  # 11.8 m: beyond the range
    obstacles.clear()
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert not obstacles[-1].detected
    assert not obstacles[-1].unknown
    assert math.isinf(obstacles[-1].distance_m)
    flight.target = (0.0, 30.0, 2.0)  # to the left, where the camera does not look
    obstacles.clear()
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert (obstacles[-1].unknown, obstacles[-1].reason) == (True, "the camera does not look where the vehicle goes")
    enable(on=False)
    flight.run(0.3)
    obstacles.clear()
    flight.run(0.5)
    assert not obstacles


def test_colour_images_become_depth_confidence_and_points(flight: FakeFlight) -> None:
    Camera(flight, disparity_px=8.0).encoding = "bgr8"
    seen: dict[str, list[object]] = {"depth": [], "confidence": [], "points": []}
    kinds = {"depth": Image, "confidence": Image, "points": PointCloud2}
    subscribers = [rospy.Subscriber(f"/zed_depth/{name}", kinds[name], seen[name].append) for name in seen]
    enable(on=True)
    assert flight.run(8.0, until=lambda: all(seen.values()))
    depth, confidence = (np.frombuffer(seen[name][-1].data, "<f4") for name in ("depth", "confidence"))
    assert np.nanmedian(depth) == pytest.approx(3.6, abs=0.05)
    assert np.median(confidence) > 0.3
    cloud = seen["points"][-1]
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "confidence"]
    assert np.median(sweep_of_cloud(cloud).points[:, 2]) == pytest.approx(3.6, abs=0.05)
    for subscriber in subscribers:
        subscriber.unregister()


FAULTS = (
    Expected("dead", "silent", "no measurement for 0.35 s"),
    Expected("black", "exposure", "left image is dark"),
    Expected("frozen", "frozen", "left image is frozen"),
    Expected("flickering", "frozen", "left image is frozen"),
    Expected("dark", "exposure", "left image is dark"),
    Expected("white", "exposure", "overexposed"),
    Expected("blurred", "blur", "image is blurred", 1.0),
    Expected("rotated", "calibration", "turned against each other", 1.0),
    Expected("shifted", "calibration", "px off the left one's rows", 1.0),
    Expected("swapped", "calibration", "left and right are swapped", 1.0),
    # Info and image come on two ways: a pair may still meet the info before it, which is right.
    Expected("wrong info", "info", "camera_info is for 960x540 images, the left image is 480x270", 1.0, misleads=False),
    Expected("future", "stamp", "in the future"),
    Expected("late", "stamp", "old when it arrives"),
    Expected("cut short", "format", "bytes for"),
    Expected("encoding", "format", "image: encoding 'jpeg'; known are"),
)


def test_each_fault_is_broken_within_its_time_never_free_and_mended_after_1_s(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    camera = Camera(flight, disparity_px=2.5)  # nothing within the range
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    assert (flight.reports[0].resource, flight.reports[0].to) == ("zed_status", "OK")
    enable(on=True)
    for fault in FAULTS:
        check_fault(flight, camera, fault, obstacles, mended_within_s=1.5)


def test_without_a_driver_it_is_named_and_with_a_silent_one_it_is_broken_after_5_s(flight: FakeFlight) -> None:
    flight.drop_driver("left")
    missing = "no camera_info on /zed/left/camera_info, no images on /zed/left/image_raw: no driver publishes there"
    flight.run(6.0)
    assert flight.run(20.0, until=lambda: flight.health[-1].reason == missing)
    assert flight.health[-1].verdict == SensorHealth.UNKNOWN
    assert not flight.reports
    started_ns = flight.now_ns
    flight.start_driver("left")
    assert flight.run(20.0, until=lambda: "driver" not in flight.health[-1].reason)
    told_ns = flight.now_ns
    assert flight.run(7.0, until=lambda: bool(flight.reports))
    assert flight.reports[0].to == "BROKEN"
    # The node notices the driver between its start and its own word of it; its report is a call that may take long on a busy machine.
    assert started_ns + 5.0 * NS <= flight.told_ns(SensorHealth.BROKEN, after_ns=started_ns) <= told_ns + 5.3 * NS
