"""Mocked skillsets as real ROS 2 processes: the interface of the real ones, on the system's clock and on /clock."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

ALULA_ROOT = Path(__file__).resolve().parents[4]
UAV = str(ALULA_ROOT / "skillsets/uav")
QUICK = "skills:\n  navigation.takeoff: {delay: 0.3, progress: f, then: [{after: 0.1, set: {navigation.flight_status: IN_AIR}}]}\n"


OBSTACLE = "data: {perception.zed_obstacle: {period: 0.1, value: {distance_m: 2.5}}}\n"


class MockProcess:
    """The process; its words are kept for failures."""

    def __init__(self, out: Path, module: str, *arguments: str) -> None:
        self._words = (out / "words.txt").open("w+")
        command = [sys.executable, "-m", module, *arguments]
        self.process = subprocess.Popen(command, env=dict(os.environ), stdout=self._words, stderr=subprocess.STDOUT)

    def words(self) -> str:
        self._words.seek(0)
        return self._words.read()

    def stop(self) -> int:
        """End it politely; return its exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(20.0)

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._words.close()


class Caller:
    """A node with clients, spun by its waits."""

    def __init__(self, *skillsets: str, namespace: str = "") -> None:
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        from skillset_ros2 import SkillsetClient

        self.node = Node("skill_runtime_mock_caller")
        self.clients = {name: SkillsetClient(self.node, name, namespace=namespace) for name in skillsets}
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def wait(self, what, limit_s: float = 30.0) -> None:
        end = time.monotonic() + limit_s
        while not what():
            missing = {name: client.missing for name, client in self.clients.items()}
            assert time.monotonic() < end, f"it did not come; missing: {missing}"
            self.turn()

    def turn(self) -> None:
        self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._executor.shutdown(timeout_sec=0)
        self.node.destroy_node()


@pytest.fixture
def call(ros2_domain):
    made = []

    def call(*skillsets: str, namespace: str = "") -> Caller:
        made.append(Caller(*skillsets, namespace=namespace))
        return made[-1]

    yield call
    for caller in made:
        caller.close()


@pytest.fixture
def mock(ros2_domain, tmp_path):
    made = []

    def mock(module: str, *arguments: str) -> MockProcess:
        made.append(MockProcess(tmp_path, module, *arguments))
        return made[-1]

    yield mock
    for process in made:
        process.kill()


def test_a_robot_is_mocked_by_one_command(mock, call, tmp_path):
    (tmp_path / "quick.yaml").write_text(QUICK)
    process = mock("skillset_ros2.mock", UAV, "--behaviour", str(tmp_path / "quick.yaml"), "--fail", "zed@0.5")
    caller = call("navigation", "perception", "mapping")
    navigation, perception = caller.clients["navigation"], caller.clients["perception"]
    caller.wait(lambda: all(client.ready for client in caller.clients.values()))
    caller.wait(lambda: navigation.resources.get("SDK_authority") == "AVAILABLE" and perception.resources.get("zed_status") == "OK")
    watch = perception.start("zed_depthmap")
    caller.wait(lambda: watch.progress == 1.0)
    refused = navigation.start("takeoff", height=30.0, speed=1.0)
    caller.wait(lambda: refused.done)
    assert (refused.outcome, refused.message) == ("NOT_VALIDATED", "height or speed is out of range: up to 20 m, up to 3 m/s")
    takeoff = navigation.start("takeoff", height=3.0, speed=1.0)
    caller.wait(lambda: takeoff.done)
    assert (takeoff.outcome, takeoff.result) == ("TERMINATED", "AT_ALTITUDE")
    assert navigation.resources["flight_status"] == "IN_AIR"
    caller.wait(lambda: watch.done)
    assert (watch.outcome, watch.result) == ("RESOURCE_INVARIANT_VIOLATED", "zed_ok")
    endless = navigation.start("lock_head", heading=0.0)
    caller.wait(lambda: endless.state.name == "RUNNING")
    endless.interrupt()
    caller.wait(lambda: endless.done)
    assert endless.outcome == "INTERRUPTED"
    again = navigation.start("lock_head", heading=0.0)
    caller.wait(lambda: again.state.name == "RUNNING")
    assert process.stop() == 0, process.words()
    caller.wait(lambda: again.done)
    assert (again.outcome, again.message) == ("FAILED", "the managers were shut down")
    assert "Traceback" not in process.words()


def test_one_generated_skillset_is_mocked_on_the_simulated_clock(mock, call):
    from rclpy.qos import QoSProfile
    from rosgraph_msgs.msg import Clock

    mock("mapping_managers.mock", "--ros-args", "-p", "use_sim_time:=true")
    caller = call("mapping")
    clock = caller.node.create_publisher(Clock, "/clock", QoSProfile(depth=10))
    client = caller.clients["mapping"]
    caller.wait(lambda: client.ready and clock.get_subscription_count() > 0)
    mapping = client.start("lidar_mapping")
    caller.wait(lambda: mapping.state.name == "RUNNING")
    now = Clock()
    now.clock.sec = 100

    def tick() -> bool:
        now.clock.sec += 1
        clock.publish(now)
        return mapping.progress == 1.0

    caller.wait(tick)
    assert not mapping.done  # it has no result that means success: it runs until it is stopped
    mapping.interrupt()
    caller.wait(lambda: mapping.done)
    assert mapping.outcome == "INTERRUPTED"
    assert client.resources["mapping_process"] == "IDLE"


def test_data_are_published_where_the_functional_layer_would(mock, call, tmp_path):
    from uav_msgs.msg import Obstacle

    (tmp_path / "data.yaml").write_text(OBSTACLE)
    mock("perception_managers.mock", "--behaviour", str(tmp_path / "data.yaml"))
    caller = call("perception")
    seen: list = []
    caller.node.create_subscription(Obstacle, "/perception/data/zed_obstacle", seen.append, 10)
    caller.wait(lambda: len(seen) > 2)
    assert seen[-1].distance_m == 2.5
    assert seen[-1].header.stamp.sec > 0


def test_two_robots_with_a_skillset_of_one_name_share_a_domain_and_nothing_else(mock, call, tmp_path):
    """Skills, events, states, transitions, data of the functional layer and the clock are each robot's own."""
    from rclpy.qos import QoSProfile
    from rosgraph_msgs.msg import Clock
    from skillset_interfaces.msg import Event

    (tmp_path / "data.yaml").write_text(OBSTACLE)
    for space, words in {"/one": ("--behaviour", str(tmp_path / "data.yaml")), "/two": ()}.items():
        clock = ("-r", f"__ns:={space}", "-r", f"/clock:={space}/clock", "-p", "use_sim_time:=true")
        mock("skillset_ros2.mock", UAV, "--skillset", "perception", *words, "--ros-args", *clock)
    callers = [call("perception", namespace=space) for space in ("/one", "/two")]
    one, two = (caller.clients["perception"] for caller in callers)
    node, now = callers[0].node, Clock()
    clocks = [node.create_publisher(Clock, f"{space}/clock", QoSProfile(depth=10)) for space in ("/one", "/two")]
    heard: list[list[Event]] = [[], []]
    for space, events in zip(("/one", "/two"), heard, strict=True):
        node.create_subscription(Event, f"{space}/perception/events", events.append, 100)

    def until(what, *ticking) -> None:
        def look() -> bool:
            now.clock.sec += 1
            for clock in ticking:
                clock.publish(now)
            callers[1].turn()
            return what()

        callers[0].wait(look)

    until(lambda: one.ready and two.ready and one.resources["zed_status"] == two.resources["zed_status"] == "OK", *clocks)
    watch, other = one.start("zed_depthmap"), two.start("lidar_depthmap")
    until(lambda: watch.state.name == other.state.name == "RUNNING")
    none = one.interrupt_all("lidar_depthmap")
    until(lambda: none.done)
    assert none.value == 0
    broken = one.transition("zed_status", "BROKEN")
    until(lambda: broken.done and watch.done)
    assert (watch.outcome, watch.result) == ("RESOURCE_INVARIANT_VIOLATED", "zed_ok")
    received: list[bool] = []

    def answered() -> bool:
        """Ask one robot after the other for what the first one's functional layer publishes."""
        told = [client.read_data("zed_obstacle") for client in (one, two)]
        until(lambda: all(answer.done for answer in told), clocks[0])
        received[:] = [answer.value.received for answer in told]
        return received[0]

    while not answered():
        pass
    assert received == [True, False]
    assert (other.state.name, two.resources["zed_status"], one.resources["zed_status"]) == ("RUNNING", "OK", "BROKEN")
    assert [{event.skill for event in events if event.skill} for events in heard] == [{"zed_depthmap"}, {"lidar_depthmap"}]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["nowhere"], "nowhere"),
        (
            [UAV, "--fail", "camera@3"],
            "there is no fault 'camera' in the behaviour; it has link:silent, zed, lidar, pilot, pilot:lands, pilot:stick, radio",
        ),
        ([UAV, "--fail", "zed@soon"], "--fail: fault 'zed@soon': write WHAT, WHAT@SECONDS"),
        ([UAV, "--skillset", "flying"], "--skillset flying: uav has no such skillset; it has"),
        ([UAV, "--behaviour", "nowhere.yaml"], "nowhere.yaml: can't be read"),
    ],
)
def test_wrong_requests_are_one_clear_line_and_exit_code_2(arguments, complaint):
    done = subprocess.run([sys.executable, "-m", "skillset_ros2.mock", *arguments], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("alula mock: ")
    assert complaint in done.stderr
    assert "Traceback" not in done.stderr


def test_the_starter_is_a_behaviour_file(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "skillset_ros2.mock", UAV, "--starter"], capture_output=True, text=True, timeout=60, check=True
    )
    from alula.language.load import load_robot
    from alula.mock import load_behaviour

    (tmp_path / "mock.yaml").write_text(done.stdout)
    skillsets = load_robot(UAV).skillsets
    behaviour = load_behaviour([tmp_path / "mock.yaml"], skillsets)
    assert len(behaviour.rules) == sum(len(skillset.skills) for skillset in skillsets)
    leaves_by_itself = [
        resource
        for skillset in skillsets
        for resource in skillset.resources
        if any(one.extern and one.source == resource.initial for one in resource.transitions)
    ]
    assert len(behaviour.timeline) == len(leaves_by_itself) > 0
