"""/zed_depth on a live graph with its neighbours faked; the clock is the test's."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rospy
from std_srvs.srv import SetBool
from uav_msgs.msg import Obstacle

from alula_testing.ros1 import wait_until
from perception_core import NS
from perception_core.testing import FakeFlight, wall_pair

NODE = str(Path(__file__).parents[1] / "scripts" / "zed_depth_node")
CAMERA_X_M = 0.3


class Camera:
    """What the faked camera shows: ``good``, ``dead``, ``black`` or ``frozen``; a wall at a disparity."""

    def __init__(self, flight: FakeFlight, disparity_px: float = 8.0) -> None:
        self.flight, self.disparity_px, self.mode = flight, disparity_px, "good"
        self.last_good_ns = 0
        flight.at_10_hz = self

    def __call__(self, stamp_ns: int) -> None:
        if self.mode == "dead":
            return
        if self.mode == "good":
            self.last_good_ns = stamp_ns
        pair = wall_pair(self.disparity_px, seed=self.last_good_ns // 1000 % 2**31)
        for side, image in zip(("left", "right"), pair, strict=True):
            self.flight.publish_image(side, stamp_ns, np.zeros_like(image) if self.mode == "black" else image)


@pytest.fixture
def flight(ros_master, start_node):
    with FakeFlight("zed_depth") as fake:
        start_node([NODE, "_enabled:=false"])
        wait_until(fake.connected, timeout_s=15.0, what="/zed_depth is up")
        rospy.wait_for_service("/zed_depth/enable", timeout=10.0)
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
    assert first.header.frame_id == "map"
    assert first.source == "zed"
    assert first.detected
    expected_m = CAMERA_X_M + 240.0 * 0.12 / 8.0
    assert abs(first.distance_m - expected_m) < 0.2
    assert abs(first.nearest_enu_m.x - expected_m) < 0.3
    camera.disparity_px = 2.5  # 11.8 m: beyond the range
    obstacles.clear()
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert not obstacles[-1].detected
    assert math.isinf(obstacles[-1].distance_m)
    enable(on=False)
    flight.run(0.3)
    obstacles.clear()
    flight.run(0.5)
    assert not obstacles


@pytest.mark.parametrize("mode", ["dead", "black", "frozen"])
def test_broken_within_0_45_s_and_ok_again_after_1_s(flight: FakeFlight, mode: str) -> None:
    camera = Camera(flight)
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    assert (flight.reports[0].resource, flight.reports[0].to) == ("zed_status", "OK")
    flight.run(0.5)
    camera.mode = mode
    assert flight.run(2.0, until=lambda: len(flight.reports) > 1)
    broken = flight.reports[1]
    assert broken.to == "BROKEN"
    assert 0.35 * NS <= broken.at_ns - camera.last_good_ns <= 0.45 * NS
    assert flight.run(1.0, until=lambda: not flight.health[-1].ok)
    assert flight.health[-1].reason
    flight.run(0.5)
    mended_ns = flight.now_ns
    camera.mode = "good"
    assert flight.run(3.0, until=lambda: len(flight.reports) > 2)
    assert flight.reports[2].to == "OK"
    assert 1.0 * NS <= flight.reports[2].at_ns - mended_ns <= 1.3 * NS


def test_nothing_at_the_start_is_unknown_then_broken(flight: FakeFlight) -> None:
    begin_ns = flight.now_ns
    assert flight.run(7.0, until=lambda: bool(flight.reports))
    assert flight.reports[0].to == "BROKEN"
    assert 5.0 * NS <= flight.reports[0].at_ns - begin_ns <= 5.3 * NS
