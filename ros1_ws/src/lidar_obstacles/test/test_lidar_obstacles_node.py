"""/lidar_obstacles on a live graph with its neighbours faked; the clock is the test's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.msg import Config
from dynamic_reconfigure.srv import Reconfigure
from std_srvs.srv import SetBool
from uav_msgs.msg import Obstacle, SensorHealth

from alula_testing.waits import HANGS_S, until
from perception_core import NS
from perception_core.testing import Expected, FakeFlight, box_cloud, check_fault

NODE = str(Path(__file__).parents[1] / "scripts" / "lidar_obstacles_node")


class Scanner:
    """What the faked LiDAR sends: ``good`` or broken in a way; a box at a place in its frame."""

    def __init__(self, flight: FakeFlight, place) -> None:
        self.flight, self.place, self.mode = flight, place, "good"
        self.last_good_ns = 0
        flight.at_10_hz = self

    def __call__(self, stamp_ns: int) -> None:
        if self.mode == "good":
            self.last_good_ns = stamp_ns
        points = box_cloud(self.place, seed=self.last_good_ns // 1000 % 2**31)
        fresh = box_cloud(self.place, seed=stamp_ns // 1000 % 2**31)
        flickering = points.copy()
        flickering[3, 2] += stamp_ns % 7
        broken = {
            "good": (points, 0.0),
            "empty": (points[:0], 0.0),
            "frozen": (flickering, 0.0),
            "blind": (fresh[fresh[:, 0] < np.abs(fresh[:, 1])], 0.0),
            "thinned": (fresh[::500], 0.0),
            "biased": (fresh * (1.0 + 0.5 / np.linalg.norm(fresh, axis=1, keepdims=True)).astype(np.float32), 0.0),
            "millimetres": (fresh * 1000, 0.0),
            "future": (fresh, 10.0),
            "late": (fresh, -1.0),
        }
        if self.mode == "cut short":
            self.flight.publish_cut_cloud(stamp_ns, fresh)
        elif self.mode != "dead":
            cloud, ahead_s = broken[self.mode]
            self.flight.publish_cloud(stamp_ns + int(ahead_s * NS), cloud)


@pytest.fixture
def flight(ros_master, start_node):
    with FakeFlight("lidar_obstacles") as fake:
        start_node([NODE, "_enabled:=false"])
        until(fake.connected, what="/lidar_obstacles is up")
        rospy.wait_for_service("/lidar_obstacles/enable", timeout=HANGS_S)
        yield fake


@pytest.fixture
def obstacles():
    seen: list[Obstacle] = []
    subscriber = rospy.Subscriber("/lidar_obstacles/obstacle", Obstacle, seen.append)
    yield seen
    subscriber.unregister()


def enable() -> None:
    assert rospy.ServiceProxy("/lidar_obstacles/enable", SetBool)(True).success


def test_sideways_towards_a_box_and_away_from_it(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    Scanner(flight, (0.0, 6.0, 0.0))  # to the left of the nose
    flight.target = (0.0, 30.0, 2.0)
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    assert (flight.reports[0].resource, flight.reports[0].to) == ("lidar_status", "OK")
    assert not obstacles
    enable()
    enabled_ns = flight.now_ns
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert obstacles[0].header.stamp.to_nsec() - enabled_ns <= 0.2 * NS
    assert (obstacles[-1].source, obstacles[-1].header.frame_id, obstacles[-1].detected) == ("lidar", "odom", True)
    assert abs(obstacles[-1].distance_m - 5.75) < 0.15
    assert abs(obstacles[-1].nearest_enu_m.y - 5.75) < 0.15
    assert abs(obstacles[-1].size_m.y - 0.6) < 0.15
    flight.target = (30.0, 0.0, 2.0)
    obstacles.clear()
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert not obstacles[-1].detected
    assert not obstacles[-1].unknown
    assert np.isinf(obstacles[-1].distance_m)


FAULTS = (
    Expected("dead", "silent", "no measurement for 0.35 s"),
    Expected("empty", "returns", "0 returns"),
    Expected("frozen", "frozen", "the sweep is the same"),
    Expected("blind", "sector", "no returns any more from -40 to 40 degrees"),
    Expected("thinned", "returns", "only 12 returns"),
    Expected("biased", "range", "all ranges became at least 0."),
    Expected("millimetres", "range", ": the coordinates are in millimetres or centimetres"),
    Expected("future", "stamp", "the stamp is 10."),
    Expected("late", "stamp", "old when it arrives"),
    Expected("cut short", "format", "can't be decoded"),
)


def test_each_fault_is_broken_within_0_45_s_never_free_and_mended_after_1_s(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    scanner = Scanner(flight, (0.0, 6.0, 0.0))
    flight.target = (30.0, 0.0, 2.0)  # where there is nothing
    enable()
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    for fault in FAULTS:
        check_fault(flight, scanner, fault, obstacles, mended_within_s=1.3)


def test_a_driver_that_stamps_the_end_and_counts_from_the_beginning_is_good(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    def measure(stamp_ns: int) -> None:
        points = box_cloud((6.0, 0.0, 0.0), seed=stamp_ns // 1000 % 2**31)
        flight.publish_cloud(stamp_ns, points, np.linspace(0.0, 0.2, len(points), dtype=np.float32))

    flight.at_10_hz = measure
    enable()
    assert flight.run(6.0, until=lambda: sum(obstacle.detected for obstacle in obstacles) >= 15)
    assert [report.to for report in flight.reports if report.to != "BROKEN"] == ["OK"], "BROKEN, if at all, until the driver is known"
    assert flight.reports[-1].to == "OK"
    assert all(obstacle.detected or obstacle.unknown for obstacle in obstacles)


def test_half_turns_are_one_sensor_and_show_both_sides(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    def measure(stamp_ns: int) -> None:
        points = box_cloud((6.0, 0.0, 0.0), seed=stamp_ns // 1000 % 2**31)
        left = points[:, 1] >= 0.0
        flight.publish_cloud(stamp_ns, points[left if stamp_ns // (NS // 10) % 2 else ~left])

    flight.at_10_hz = measure
    enable()
    assert flight.run(4.0, until=lambda: len(obstacles) >= 20)
    assert {report.to for report in flight.reports} == {"OK"}
    assert all(obstacle.detected for obstacle in obstacles[3:])
    assert all(abs(obstacle.size_m.y - 0.6) < 0.15 for obstacle in obstacles[3:])


def test_an_overturned_sensor_is_unknown_and_never_free(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    def measure(stamp_ns: int) -> None:
        points = box_cloud((0.0, 6.0, 0.0), seed=stamp_ns // 1000 % 2**31)
        flight.publish_cloud(stamp_ns, points * np.array([1.0, -1.0, -1.0], np.float32))

    flight.at_10_hz = measure
    flight.target = (0.0, 30.0, 2.0)  # the box is there, and seen on the other side
    enable()
    flight.run(3.0)
    assert (flight.health[-1].verdict, flight.health[-1].fault) == (SensorHealth.UNKNOWN, "calibration")
    assert obstacles
    assert all(obstacle.unknown for obstacle in obstacles)


def test_parameters_are_changed_in_flight_and_refused_out_of_range(flight: FakeFlight, obstacles: list[Obstacle]) -> None:
    Scanner(flight, (0.0, 6.0, 0.0))
    flight.target = (0.0, 30.0, 2.0)
    updates: list[Config] = []
    subscriber = rospy.Subscriber("/lidar_obstacles/parameter_updates", Config, updates.append)
    client = Client("/lidar_obstacles", timeout=10.0)
    assert flight.run(3.0, until=lambda: bool(flight.reports))
    enable()
    assert client.update_configuration({"length_m": 4.0})["length_m"] == 4.0
    assert flight.run(2.0, until=lambda: len(obstacles) >= 3)
    assert not obstacles[-1].detected  # the box is at 5.75 m
    until(lambda: any(p.value == 4.0 for u in updates for p in u.doubles if p.name == "length_m"), what="the change is told")
    change = rospy.ServiceProxy("/lidar_obstacles/set_parameters", Reconfigure)
    with pytest.raises(rospy.ServiceException, match=r"~length_m is 0\.5, expected 1 to 50"):
        change(encode_config({"length_m": 0.5, "half_width_m": 2.0}))
    assert rospy.get_param("/lidar_obstacles/half_width_m") == 1.25
    client.close()
    subscriber.unregister()
