"""/lidar_obstacles on a live graph with its neighbours faked; the clock is the test's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rospy
from std_srvs.srv import SetBool
from uav_msgs.msg import Obstacle

from alula_testing.ros1 import wait_until
from perception_core import NS
from perception_core.testing import FakeFlight, box_cloud

NODE = str(Path(__file__).parents[1] / "scripts" / "lidar_obstacles_node")


class Scanner:
    """What the faked LiDAR sends: ``good``, ``dead``, ``empty`` or ``frozen``; a box at a place in its frame."""

    def __init__(self, flight: FakeFlight, place) -> None:
        self.flight, self.place, self.mode = flight, place, "good"
        self.last_good_ns = 0
        flight.at_10_hz = self

    def __call__(self, stamp_ns: int) -> None:
        if self.mode == "dead":
            return
        if self.mode == "good":
            self.last_good_ns = stamp_ns
        points = box_cloud(self.place, seed=self.last_good_ns // 1000 % 2**31)
        self.flight.publish_cloud(stamp_ns, points[:0] if self.mode == "empty" else points)


@pytest.fixture
def flight(ros_master, start_node):
    with FakeFlight("lidar_obstacles") as fake:
        start_node([NODE, "_enabled:=false"])
        wait_until(fake.connected, timeout_s=15.0, what="/lidar_obstacles is up")
        rospy.wait_for_service("/lidar_obstacles/enable", timeout=10.0)
        yield fake


@pytest.fixture
def obstacles():
    seen: list[Obstacle] = []
    subscriber = rospy.Subscriber("/lidar_obstacles/obstacle", Obstacle, seen.append)
    yield seen
    subscriber.unregister()


def test_sideways_towards_a_box_and_away_from_it(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    Scanner(flight, (0.0, 6.0, 0.0))  # to the left of the nose
    flight.target = (0.0, 30.0, 2.0)
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    assert (flight.reports[0].resource, flight.reports[0].to) == ("lidar_status", "OK")
    assert not obstacles
    assert rospy.ServiceProxy("/lidar_obstacles/enable", SetBool)(True).success
    enabled_ns = flight.now_ns
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert obstacles[0].header.stamp.to_nsec() - enabled_ns <= 0.2 * NS
    assert (obstacles[-1].source, obstacles[-1].header.frame_id, obstacles[-1].detected) == ("lidar", "map", True)
    assert abs(obstacles[-1].distance_m - 5.75) < 0.15
    assert abs(obstacles[-1].nearest_enu_m.y - 5.75) < 0.15
    flight.target = (30.0, 0.0, 2.0)
    obstacles.clear()
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert not obstacles[-1].detected
    assert np.isinf(obstacles[-1].distance_m)


@pytest.mark.parametrize("mode", ["dead", "empty", "frozen"])
def test_broken_within_0_45_s_and_ok_again_after_1_s(flight: FakeFlight, mode: str) -> None:
    scanner = Scanner(flight, (0.0, 6.0, 0.0))
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    flight.run(0.5)
    scanner.mode = mode
    assert flight.run(2.0, until=lambda: len(flight.reports) > 1)
    assert flight.reports[1].to == "BROKEN"
    assert 0.35 * NS <= flight.reports[1].at_ns - scanner.last_good_ns <= 0.45 * NS
    flight.run(0.5)
    mended_ns = flight.now_ns
    scanner.mode = "good"
    assert flight.run(3.0, until=lambda: len(flight.reports) > 2)
    assert flight.reports[2].to == "OK"
    assert 1.0 * NS <= flight.reports[2].at_ns - mended_ns <= 1.3 * NS
