"""/lidar_mapping on a live graph with its neighbours faked; the clock is the test's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, TransformStamped, Vector3
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import MappingState

from alula_testing.ros1 import end_process
from alula_testing.waits import until
from lidar_mapping import read_ply
from perception_core import NS
from perception_core.testing import FakeFlight, framed, send_raw

NODE = str(Path(__file__).parents[1] / "scripts" / "lidar_mapping_node")
LIDAR_HEIGHT_M = 0.1


class Walls:
    """A LiDAR between a wall at x = 6, one at y = 4 and the ground, in the map; the vehicle hovers at 2 m."""

    def __init__(self, flight: FakeFlight) -> None:
        self.flight = flight
        self.cut = False
        flight.at_10_hz = self

    def __call__(self, stamp_ns: int) -> None:
        rng = np.random.default_rng(stamp_ns // 1000 % 2**31)
        a, b = rng.uniform(-6, 6, 2000), rng.uniform(0, 4, 2000)
        walls = [(np.full(2000, 6.0), a, b), (a, np.full(2000, 4.0), b), (a, rng.permutation(a), np.zeros(2000))]
        points = np.vstack([np.stack(wall, axis=1) for wall in walls]) - [*self.flight.position]
        points = np.vstack([points - [0.0, 0.0, LIDAR_HEIGHT_M], rng.uniform(-0.5, 0.5, (50, 3))])
        noisy = (points + rng.normal(0.0, 0.01, points.shape)).astype(np.float32)
        (self.flight.publish_cut_cloud if self.cut else self.flight.publish_cloud)(stamp_ns, noisy)


@pytest.fixture
def flight(ros_master, start_node, tmp_path):
    with FakeFlight("lidar_mapping") as fake:
        fake.process = start_node([NODE, "_enabled:=false", f"_map_path:={tmp_path / 'map.ply'}"])
        until(fake.listens, what="/lidar_mapping is up")
        rospy.wait_for_service("/lidar_mapping/save", timeout=10.0)
        yield fake


@pytest.fixture
def states():
    seen: list[MappingState] = []
    subscriber = rospy.Subscriber("/lidar_mapping/state", MappingState, seen.append)
    yield seen
    subscriber.unregister()


def check_map(points) -> None:
    off = np.min(np.abs([points[:, 0] - 6, points[:, 1] - 4, points[:, 2]]), axis=0)
    assert len(points) > 5000
    assert np.sqrt(np.mean(off**2)) < 0.03
    assert np.linalg.norm(points - [0, 0, 2.1], axis=1).min() > 1.1


def test_maps_while_enabled_and_saves_on_demand_as_it_goes_and_at_the_end(flight, states, tmp_path) -> None:
    path = tmp_path / "map.ply"
    enable = rospy.ServiceProxy("/lidar_mapping/enable", SetBool)
    save = rospy.ServiceProxy("/lidar_mapping/save", Trigger)
    Walls(flight)
    flight.run(0.5)
    assert not any(state.scans for state in states)
    assert enable(True).success
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 12)
    assert states[-1].running
    assert states[-1].fitness > 0.8
    assert states[-1].correction_m < 0.03
    assert states[-1].header.stamp.to_nsec() <= flight.now_ns
    answer = save()
    assert answer.success, answer.message
    check_map(read_ply(path))
    clouds: list[PointCloud2] = []
    listener = rospy.Subscriber("/lidar_mapping/map", PointCloud2, clouds.append)
    assert flight.run(6.0, until=lambda: bool(clouds))
    assert (clouds[0].header.frame_id, clouds[0].width > 5000) == ("map", True)
    listener.unregister()
    path.unlink()
    assert flight.run(12.0, until=path.exists)
    assert enable(False).success
    assert flight.run(1.0, until=lambda: not states[-1].running)
    scans = states[-1].scans
    flight.run(0.5)
    assert states[-1].scans == scans
    path.unlink()
    path.mkdir()  # a place that can't be written
    answer = save()
    assert (answer.success, "map.ply" in answer.message) == (False, True)
    path.rmdir()
    assert enable(True).success
    assert flight.run(3.0, until=lambda: states[-1].scans > scans)
    end_process(flight.process)
    check_map(read_ply(path))


def test_started_again_after_a_crash_it_goes_on_with_map_and_work(flight, states, start_node, tmp_path) -> None:
    Walls(flight)
    assert rospy.ServiceProxy("/lidar_mapping/enable", SetBool)(True).success
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 6)
    assert rospy.ServiceProxy("/lidar_mapping/save", Trigger)().success
    flight.process.kill()
    flight.process.wait()
    until(lambda: not flight.listens(), what="/lidar_mapping's connections are gone")
    before = len(read_ply(tmp_path / "map.ply"))
    states.clear()
    start_node([NODE])
    until(flight.listens, what="/lidar_mapping is up again")
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 1)
    assert states[-1].running
    assert states[-1].points >= before


FLOWN_M = (3.0, -2.0, 0.5)
"""T_map_odom, a shift: what the autopilot has drifted since the take-off."""


@pytest.fixture
def guidance(flight):
    """What the guidance says of `map` on /tf, and all that is said there of `map -> odom`."""
    tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
    heard: list[float] = []

    def on_transforms(message: TFMessage) -> None:
        heard.extend(t.transform.translation.x for t in message.transforms if t.child_frame_id == "odom")

    listener = rospy.Subscriber("/tf", TFMessage, on_transforms)

    def say(stamp_ns: int) -> None:
        item = TransformStamped(
            header=Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id="odom"), child_frame_id="guidance_map"
        )
        item.transform.translation, item.transform.rotation = Vector3(*(-x for x in FLOWN_M)), Quaternion(0.0, 0.0, 0.0, 1.0)
        tf.publish(TFMessage(transforms=[item]))

    yield say, heard, tf
    listener.unregister()
    tf.unregister()


@pytest.mark.parametrize("saved", [False, True], ids=["with no map", "with the saved map"])
def test_started_again_after_a_crash_it_begins_where_the_guidance_flies(flight, states, guidance, start_node, tmp_path, saved) -> None:
    say, heard, tf = guidance
    walls = Walls(flight)

    def measure(stamp_ns: int) -> None:
        say(stamp_ns)
        walls(stamp_ns)

    flight.at_10_hz = measure
    poses: list[PoseWithCovarianceStamped] = []
    listener = rospy.Subscriber("/lidar_mapping/pose", PoseWithCovarianceStamped, poses.append)
    until(lambda: tf.get_num_connections() == 2, what="node and test listen to /tf")
    assert rospy.ServiceProxy("/lidar_mapping/enable", SetBool)(True).success
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 3 and len(poses) >= 3)
    if saved:
        assert rospy.ServiceProxy("/lidar_mapping/save", Trigger)().success
    flight.process.kill()
    flight.process.wait()
    until(lambda: not flight.listens(), what="/lidar_mapping's connections are gone")
    until(lambda: tf.get_num_connections() == 1, what="only the test listens to /tf")
    assert (tmp_path / "map.ply").exists() == saved
    there = np.add(flight.position, FLOWN_M)
    states.clear()
    poses.clear()
    heard.clear()
    start_node([NODE])
    until(lambda: flight.listens() and tf.get_num_connections() == 2, what="/lidar_mapping is up again")
    assert flight.run(20.0, until=lambda: bool(states) and states[-1].scans >= 3 and len(poses) >= 3 and len(heard) >= 3)
    listener.unregister()
    told = np.array([[p.pose.pose.position.x, p.pose.pose.position.y, p.pose.pose.position.z] for p in poses])
    assert np.linalg.norm(told - there, axis=1).max() < 0.05
    assert heard == pytest.approx([FLOWN_M[0]] * len(heard), abs=0.05), "never the identity"
    assert not states[-1].problem


def test_readings_of_an_imu_that_is_mounted_turned_are_turned_into_the_body(flight, states) -> None:
    walls = Walls(flight)
    imu = rospy.Publisher("/imu/data", Imu, queue_size=10, latch=True)
    mount = TransformStamped(header=Header(frame_id="base_link"), child_frame_id="imu")
    mount.transform.rotation = Quaternion(*Rotation.from_euler("x", 90, degrees=True).as_quat())
    flight.mount(mount)
    until(imu.get_num_connections, what="it listens to the IMU")

    def measure(stamp_ns: int) -> None:
        reading = Imu(header=Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id="imu"))
        reading.linear_acceleration.y = 9.81  # up, in the axes of the IMU
        imu.publish(reading)
        walls(stamp_ns)

    flight.at_10_hz = measure
    poses: list[PoseWithCovarianceStamped] = []
    listener = rospy.Subscriber("/lidar_mapping/pose", PoseWithCovarianceStamped, poses.append)
    flight.run(0.5)
    assert rospy.ServiceProxy("/lidar_mapping/enable", SetBool)(True).success
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 12 and len(poses) >= 12)
    assert states[-1].rejected == 0
    assert (
        np.linalg.norm([[p.pose.pose.position.x, p.pose.pose.position.y, p.pose.pose.position.z - 2.0] for p in poses], axis=1).max() < 0.03
    )
    for end in (listener, imu):
        end.unregister()


def test_a_gyro_that_is_biased_where_the_vehicle_stands_does_not_turn_the_map(flight, states) -> None:
    walls = Walls(flight)
    imu = rospy.Publisher("/imu/data", Imu, queue_size=100)
    until(imu.get_num_connections, what="it listens to the IMU")

    def measure(stamp_ns: int) -> None:
        for before_ns in range(90_000_000, -1, -10_000_000):
            reading = Imu(header=Header(stamp=rospy.Time.from_sec((stamp_ns - before_ns) / NS), frame_id="base_link"))
            reading.angular_velocity.z, reading.linear_acceleration.z = 0.1, 9.81
            imu.publish(reading)
        walls(stamp_ns)

    flight.at_10_hz = measure
    poses: list[PoseWithCovarianceStamped] = []
    listener = rospy.Subscriber("/lidar_mapping/pose", PoseWithCovarianceStamped, poses.append)
    flight.run(5.0)
    assert rospy.ServiceProxy("/lidar_mapping/enable", SetBool)(True).success
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 12 and len(poses) >= 12)
    headings_deg = [np.degrees(2.0 * np.arctan2(p.pose.pose.orientation.z, p.pose.pose.orientation.w)) for p in poses]
    assert np.abs(headings_deg).max() < 0.1
    for end in (listener, imu):
        end.unregister()


def test_garbage_on_its_inputs_is_left_out_and_it_maps_on(flight, states) -> None:
    walls = Walls(flight)
    imu = rospy.Publisher("/imu/data", Imu, queue_size=10)
    until(imu.get_num_connections, what="it listens to the IMU")
    assert rospy.ServiceProxy("/lidar_mapping/enable", SetBool)(True).success
    assert flight.run(8.0, until=lambda: bool(states) and states[-1].scans >= 3)
    scans = states[-1].scans

    walls.cut = True
    flight.run(0.5)
    walls.cut = False
    send_raw(imu, framed(b"\x00" * 30))
    for stamp_ns, force in ((flight.now_ns, np.nan), (flight.now_ns, 1e30), (flight.now_ns + 1000 * NS, 9.81)):
        reading = Imu(header=Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id="base_link"))
        reading.linear_acceleration.z = force
        imu.publish(reading)
    stamp_ns, cloud = flight.now_ns, np.full((300, 3), np.nan, np.float32)
    flight.publish_cloud(stamp_ns, cloud)
    flight.publish_cloud(stamp_ns + 10 * NS, cloud + 1.0)
    flight.publish_cloud(stamp_ns, cloud[:0])

    assert flight.run(8.0, until=lambda: states[-1].scans >= scans + 15 and not states[-1].refusal)
    assert states[-1].fitness > 0.8
    assert not states[-1].problem
    imu.unregister()
