"""The node on a live ROS graph, with a real MAVLink client over TCP."""

import json
import math
import socket
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, PointCloud2
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage
from uav_msgs.srv import SetSensor
from uav_simulator_ardupilot import InThread, Peer

from alula.common.network import free_port
from alula_testing.waits import HANGS_S, until
from uav_simulator.autopilot.link_server import LinkServer
from uav_simulator.flown import SimulatedAutopilotVehicle

NODE = Path(__file__).parents[1] / "scripts" / "uav_simulator_node"
PACE_TOPIC = "/uav_simulator_test/work"
PACE_TIMEOUT_S = 5.0  # wall clock; what is let on by a word comes well before, on a busy machine too


class Collector:
    """The messages of some topics, as they come."""

    def __init__(self, **topics):
        self.messages = {name: [] for name in topics}
        self._subscribers = [
            rospy.Subscriber(topic, kind, self.messages[name].append, queue_size=100, tcp_nodelay=True)
            for name, (topic, kind) in topics.items()
        ]

    def close(self):
        for subscriber in self._subscribers:
            subscriber.unregister()

    def count(self, name):
        return len(self.messages[name])

    def wait(self, name, count=1, timeout_s=HANGS_S):
        goal = self.count(name) + count
        until(lambda: self.count(name) >= goal, timeout_s=timeout_s, what=f"{count} more messages of {name}")
        return self.messages[name][-1]


def clock_steps_ns(seen, from_s=0.0, to_s=float("inf")):
    """Return the steps between the clock messages within a stretch of simulated time."""
    stamps = [m.clock.to_nsec() for m in seen.messages["clock"] if from_s <= m.clock.to_sec() <= to_s]
    return [after - before for before, after in pairwise(stamps)]


def wait_until_time_goes_on(collect):
    """Wait for a second of simulated time: its first tick is told again and again while it is held."""
    ticks = collect(clock=("/clock", Clock)).messages["clock"]
    until(lambda: ticks and ticks[-1].clock.to_sec() > 1.0, what="a second of simulated time")


class Client:
    """A MAVLink client over TCP."""

    def __init__(self, port):
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=5.0)
        self._socket.settimeout(0.05)
        self._parser = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)

    def receive(self):
        try:
            return self._parser.parse_buffer(self._socket.recv(65536)) or []
        except TimeoutError:
            return []

    def wait(self, name, condition=lambda _: True, timeout_s=HANGS_S):
        found = []

        def came():
            found.extend(m for m in self.receive() if m.get_type() == name and m.get_srcSystem() == 1 and condition(m))
            return bool(found)

        until(came, timeout_s=timeout_s, what=name)
        return found[0]

    def command(self, command, *params):
        values = [*params, *([0.0] * (7 - len(params)))]
        self._socket.sendall(mavlink.MAVLink_command_long_message(1, 1, command, 0, *values).pack(self._parser))
        return self.wait("COMMAND_ACK", lambda m: m.command == command).result

    def close(self):
        self._socket.close()


@pytest.fixture
def collect():
    collectors = []

    def start(**topics):
        collectors.append(Collector(**topics))
        return collectors[-1]

    yield start
    for collector in collectors:
        collector.close()


@pytest.fixture
def start_simulator(start_node):
    """Return a function that starts the simulator on any free port and waits for its clock; it returns the MAVLink port."""
    started = []

    def start(*params):
        rospy.set_param("/uav_simulator/mavlink_port", 0)
        started.append(start_node([sys.executable, str(NODE), "__name:=uav_simulator", *params]))
        rospy.wait_for_message("/clock", Clock, timeout=HANGS_S)
        return int(rospy.get_param("/uav_simulator/mavlink_port"))

    yield start
    for process in started:
        process.terminate()
        process.wait(10.0)
    rospy.delete_param("/uav_simulator")


def break_stamps_and_infos(set_sensor, seen):
    def lag_s():
        return seen.messages["clock"][-1].clock.to_sec() - seen.messages["left"][-1].header.stamp.to_sec()

    assert set_sensor("zed", "late").accepted
    until(lambda: lag_s() > 0.45, what="an image that comes late")
    assert set_sensor("zed", "future").accepted
    until(lambda: lag_s() < -9.0, what="a stamp of the future")
    assert set_sensor("zed", "wrong_info").accepted
    until(lambda: seen.messages["info"][-1].width == 960, what="the info of another resolution")
    assert seen.messages["info"][-1].P[3] == pytest.approx(-480.0 * 0.12)
    assert set_sensor("zed", "ok").accepted
    until(lambda: seen.messages["info"][-1].width == 480, what="the right info again")


def check_measurements(seen):
    """The first of each kind are what the real drivers send; the IMU was broken before."""
    right = seen.wait("right")
    seen.wait("lidar")
    # Topics are connected one after the other: another may be heard later, and the first image of one eye may have no fellow.
    until(lambda: seen.count("info") and seen.count("tf"), what="camera infos and transforms")
    until(lambda: set.intersection(*({m.header.stamp.to_nsec() for m in seen.messages[eye]} for eye in ("left", "right"))), what="pair")
    assert (right.width, right.height, right.encoding, len(right.data)) == (480, 270, "mono8", 480 * 270)
    assert seen.messages["info"][-1].P[3] == pytest.approx(-240.0 * 0.12)
    assert [f.name for f in seen.messages["lidar"][-1].fields] == ["x", "y", "z", "intensity", "time"]
    assert {t.child_frame_id for t in seen.messages["tf"][0].transforms} == {"zed_left", "zed_right", "camera", "lidar", "imu"}
    assert seen.count("imu") == 0, "broken from the beginning"


def climb(port, seen):
    """Take off as a companion does, over MAVLink."""
    client = Client(port)
    assert client.command(511, 245, 100_000) == 0
    assert client.command(176, 1, 4) == 0
    assert client.command(400, 1) == 0
    assert client.command(22, 0, 0, 0, 0, 0, 0, 3.0) == 0
    client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR, timeout_s=HANGS_S)
    until(lambda: seen.messages["pose"][-1].pose.position.z > 2.8, what="the vehicle is up")
    client.close()
    again = Client(port)
    assert again.command(512, 242) == 0, "a client may come back"
    again.close()


def break_the_zed(set_sensor, seen):
    """Each mode shows in the images; what is dead is silent, and nothing else is."""
    assert not set_sensor("sonar", "dead").accepted
    assert set_sensor("zed", "dead").accepted

    def silent_s():
        """By the stamps: an image that was sent before may come late, over a connection of its own."""
        return (seen.messages["lidar"][-1].header.stamp - seen.messages["left"][-1].header.stamp).to_sec()

    until(lambda: silent_s() > 0.5, what="five sweeps without an image")
    seen.wait("lidar", 5)
    assert silent_s() > 0.5
    assert set_sensor("zed", "frozen").accepted
    seen.wait("left", 2)
    first, second = seen.messages["left"][-2:]
    assert first.data == second.data
    assert first.header.stamp < second.header.stamp
    assert set_sensor("zed", "black").accepted
    until(lambda: not any(seen.messages["left"][-1].data), what="a black image")
    assert set_sensor("zed", "ok").accepted
    until(lambda: any(seen.messages["left"][-1].data), what="an image again")


def test_a_client_takes_off_and_a_broken_zed_falls_silent(start_simulator, collect, tmp_path):
    port = start_simulator("_rate:=0", f"_world_path:={tmp_path / 'world.ply'}", "_faults:=imu")
    seen = collect(
        left=("/zed/left/image_raw", Image),
        right=("/zed/right/image_raw", Image),
        info=("/zed/right/camera_info", CameraInfo),
        lidar=("/lidar/points", PointCloud2),
        imu=("/imu/data", Imu),
        pose=("/sim/true_pose", PoseStamped),
        state=("/sim/state", String),
        tf=("/tf_static", TFMessage),
        clock=("/clock", Clock),
    )
    check_measurements(seen)
    assert (tmp_path / "world.ply").stat().st_size > 10_000
    climb(port, seen)
    set_sensor = rospy.ServiceProxy("/sim/set_sensor", SetSensor)
    break_the_zed(set_sensor, seen)
    break_stamps_and_infos(set_sensor, seen)
    state = json.loads(seen.wait("state").data)
    assert state["lift_off_s"] > 0.0
    assert state["collisions"] == 0
    assert [(f["sensor"], f["mode"]) for f in state["faults"]] == [
        ("imu", "dead"),
        ("zed", "dead"),
        ("zed", "frozen"),
        *(("zed", mode) for mode in ("black", "ok", "late", "future", "wrong_info", "ok")),
    ]
    steps = clock_steps_ns(seen)
    assert min(steps) == 20_000_000, "50 Hz, and never backwards"
    assert {step % 20_000_000 for step in steps} == {0}, "flat out, whole ticks may be dropped on the way, none is bent"


def test_time_begins_when_all_that_work_for_it_are_there(start_simulator, collect):
    others, states = f"{PACE_TOPIC}_of_another", f"{PACE_TOPIC}_of_a_skillset"
    start_simulator("_rate:=0", f"_pace_topics:=[{PACE_TOPIC},{others},{states}=inf]", "_start_timeout_s:=60", "_pace_timeout_s:=4")
    seen = collect(clock=("/clock", Clock), imu=("/imu/data", Imu))
    first = rospy.Publisher(PACE_TOPIC, Header, queue_size=1)
    until(lambda: first.get_num_connections() > 0, what="the simulator listens")
    seen.wait("clock", 5)  # told again and again, so that a node that comes late has a clock, too
    assert {m.clock.to_nsec() for m in seen.messages["clock"]} == {20_000_000}
    assert not seen.count("imu")
    second = rospy.Publisher(others, Header, queue_size=1)
    until(lambda: second.get_num_connections() > 0, what="the simulator listens")
    seen.wait("clock", seen.count("clock") + 3)
    assert not seen.count("imu")
    third = rospy.Publisher(states, String, queue_size=1, latch=True)
    until(lambda: third.get_num_connections() > 0, what="the simulator listens")
    seen.wait("clock", seen.count("clock") + 3)
    assert not seen.count("imu"), "it has not said anything yet"
    third.publish(String(""))
    seen.wait("imu")
    assert seen.messages["imu"][0].header.stamp.to_sec() < 0.05, "the first measurements are heard"
    first.publish(Header(stamp=rospy.Time(100)))
    until(lambda: seen.messages["clock"][-1].clock.to_sec() >= 0.32, what="the limit")
    held_from = time.monotonic()
    until(lambda: seen.messages["clock"][-1].clock.to_sec() > 0.36, what="time lets go")
    assert time.monotonic() - held_from > 1.0, "the other node has not said anything yet, and is waited for"
    first.unregister()
    second.unregister()
    third.unregister()


def test_subscribers_that_are_there_first_miss_no_first_measurement(start_simulator, collect):
    seen = collect(imu=("/imu/data", Imu), pose=("/sim/true_pose", PoseStamped))
    start_simulator("_rate:=0")
    for name in ("imu", "pose"):
        until(lambda name=name: seen.count(name) > 0, what=name)
        assert seen.messages[name][0].header.stamp.to_nsec() <= 20_000_000, f"the first {name} is of the first tick"


def test_a_subscriber_that_has_died_is_not_waited_for_without_end(ros_master, start_simulator, collect):
    master = ServerProxy(ros_master)
    gone = ("/gone", "/imu/data", "sensor_msgs/Imu", f"http://127.0.0.1:{free_port()}/")
    assert master.registerSubscriber(*gone)[0] == 1
    try:
        start_simulator("_rate:=0", "_start_timeout_s:=0.5")
        wait_until_time_goes_on(collect)
    finally:
        master.unregisterSubscriber(gone[0], gone[1], gone[3])


def test_time_begins_without_a_node_that_never_comes(start_simulator, collect):
    start_simulator("_rate:=0", f"_pace_topics:=[{PACE_TOPIC}]", "_start_timeout_s:=0.5")
    wait_until_time_goes_on(collect)


def test_time_waits_for_the_nodes_that_work_for_it_and_lets_go_of_the_dead(start_simulator, collect):
    start_simulator("_rate:=0", f"_pace_topics:=[{PACE_TOPIC}]", f"_pace_timeout_s:={PACE_TIMEOUT_S}")
    seen = collect(clock=("/clock", Clock))

    def now_s():
        return seen.messages["clock"][-1].clock.to_sec()

    work = rospy.Publisher(PACE_TOPIC, Header, queue_size=1)
    until(lambda: work.get_num_connections() > 0, what="the simulator listens")
    seen.wait("clock")
    words = []
    for _ in range(5):  # each word lets time go on for as long as the limit
        stamp = now_s()
        words.append(stamp)
        work.publish(Header(stamp=rospy.Time.from_sec(stamp)))
        until(lambda stamp=stamp: now_s() >= stamp + 0.29, timeout_s=0.9 * PACE_TIMEOUT_S, what="time goes on")
    stamp = now_s()
    work.publish(Header(stamp=rospy.Time.from_sec(stamp)))
    until(lambda: now_s() >= stamp + 0.29, timeout_s=0.9 * PACE_TIMEOUT_S, what="time goes on")
    held_at, held_from = now_s(), time.monotonic()
    until(lambda: now_s() > held_at + 0.1, what="time lets go")
    assert time.monotonic() - held_from > 0.6 * PACE_TIMEOUT_S
    stamp = now_s()
    work.publish(Header(stamp=rospy.Time.from_sec(stamp)))
    until(lambda: now_s() >= stamp + 0.29, timeout_s=0.9 * PACE_TIMEOUT_S, what="time waits again")
    held_from = time.monotonic()
    work.unregister()
    until(lambda: now_s() > stamp + 0.6, what="time lets go")
    assert time.monotonic() - held_from < 0.9 * PACE_TIMEOUT_S, "a node that has gone is not waited for"
    # Before the second word and once the timeout is over, time runs flat out.
    assert set(clock_steps_ns(seen, from_s=words[2], to_s=held_at)) == {20_000_000}, "paced, no tick is lost"


def test_ardupilot_flies_the_body_and_makes_the_clock(start_node, collect):
    if rospy.has_param("/uav_simulator/ardupilot_port"):
        rospy.delete_param("/uav_simulator/ardupilot_port")
    node = start_node([sys.executable, str(NODE), "__name:=uav_simulator", "_vehicle:=ardupilot", "_ardupilot_port:=0", "_rate:=0"])
    try:
        port = lambda: int(rospy.get_param("/uav_simulator/ardupilot_port", 0))  # noqa: E731
        until(lambda: port() > 0, what="the body waits for ArduPilot")
        seen = collect(clock=("/clock", Clock), pose=("/sim/true_pose", PoseStamped), state=("/sim/state", String))
        peer = Peer(port())
        flight = InThread(lambda: peer.fly(3.0, math.pi / 2, 4.0))
        until(lambda: not flight.running, what="the flight is over")
        flight.join()
        end_s = peer.state["timestamp"]
        last = lambda name: seen.messages[name][-1] if seen.count(name) else None  # noqa: E731
        until(lambda: last("clock") and last("clock").clock.to_sec() >= end_s - 0.021, timeout_s=HANGS_S, what="its clock")
        until(lambda: last("pose") and last("pose").header.stamp.to_sec() >= end_s - 0.1, timeout_s=HANGS_S, what="its last pose")
        lifted_off = lambda: (json.loads(last("state").data)["lift_off_s"] or 0.0) > 0.0  # noqa: E731
        until(lambda: last("state") and lifted_off(), timeout_s=HANGS_S, what="its lift-off")
        assert last("clock").clock.to_sec() == pytest.approx(end_s, abs=0.021)
        assert last("pose").pose.position.z == pytest.approx(-peer.state["position"][2], abs=0.1)
        assert {step % 20_000_000 for step in clock_steps_ns(seen)} == {0}
    finally:
        node.terminate()
        node.wait(10.0)
        rospy.delete_param("/uav_simulator")


def test_an_autopilot_that_is_followed_is_not_kept_waiting_by_a_node_that_hangs(start_node, collect):
    peer = SimulatedAutopilotVehicle(seed=0)
    server = LinkServer(peer.endpoint, None, port=0, gcs_port=0)
    told_s = [0.0]

    def go():
        told_s[0] += 0.02
        peer.tick(told_s[0], 0.02)
        server.serve(0.01)

    vehicle = f"_vehicle:=followed:tcp:127.0.0.1:{server.port}"
    node = start_node([sys.executable, str(NODE), "__name:=uav_simulator", vehicle, "_rate:=0", f"_pace_topics:=[{PACE_TOPIC}]"])
    work = rospy.Publisher(PACE_TOPIC, Header, queue_size=1)
    seen = collect(clock=("/clock", Clock), lidar=("/lidar/points", PointCloud2), imu=("/imu/data", Imu))
    try:
        until(lambda: go() or seen.count("lidar") > 1, what="a sweep")
        work.publish(Header(stamp=rospy.Time.from_sec(seen.messages["clock"][-1].clock.to_sec())))  # then it hangs
        begun_s = told_s[0]
        first_s = seen.messages["clock"][-1].clock.to_sec()
        for _ in range(400):  # as many ticks at once as the machine can do
            go()
        until(
            lambda: server.serve(0.01) or seen.messages["clock"][-1].clock.to_sec() > first_s + 7.5,
            timeout_s=HANGS_S,
            what="the clock is with the autopilot",
        )
        assert told_s[0] - begun_s == pytest.approx(8.0)
        assert seen.count("imu") > 350
    finally:
        node.terminate()
        node.wait(10.0)
        server.close()
        rospy.delete_param("/uav_simulator")


@pytest.mark.usefixtures("ros_master")
def test_a_wrong_parameter_ends_the_node_with_one_line():
    done = subprocess.run(
        [sys.executable, str(NODE), "__name:=uav_simulator_wrong", "_mavlink_port:=0", "_faults:=sonar@3"],
        capture_output=True,
        text=True,
        timeout=HANGS_S,
        check=False,
    )
    assert done.returncode == 2
    assert "there is no 'sonar' to break; choose one of zed, lidar, camera, imu" in done.stderr
    assert "Traceback" not in done.stderr
