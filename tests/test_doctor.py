"""`alula doctor DEPLOYMENT`: what it finds on two computers, with a real master, nodes of ROS 1 and nodes of ROS 2."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest
import rclpy
from hypothesis import given
from hypothesis import strategies as st
from skillset_interfaces.msg import ResourceStates

from alula.common.deployments import Deployment, Discovery
from alula.common.fast_dds import leave
from alula.common.network import claim_domain
from alula.common.robots import RobotFolder
from alula.generate.bridge import bridge_configuration
from alula.generate.scaffold.skeleton import files_of
from alula.language.load import load_robot
from alula_flight.doctor import clock, dds
from alula_flight.doctor.base import look_at_way_back, read_base
from alula_flight.doctor.disk import look_at_disk
from alula_flight.doctor.findings import Level
from alula_flight.doctor.names import look_at_names
from alula_flight.station.master import offset_of
from alula_flight.station.parts import Places, network_profile
from alula_testing.networks import Computer, Network
from alula_testing.ros1 import END_WITH_PARENT, end_process
from alula_testing.waits import until

ROOT = Path(__file__).resolve().parents[1]
NODE = ROOT / "tests/support/alula_testing/base_node.py"
FILE = """ros1: {{master: "http://{master}", address: {address}}}
ros2: {{domain: {domain}, discovery: {discovery}}}
managers: {{rover: "rover_robot.hooks:make_hooks"}}
bridge: rover_bridge.yaml
record: {{topics: [/rover/odom], disk_gb: 0.1}}
"""
SILENT = "/rover/reported: no reporter says that it lives, so resources with a `silence` become unknown"


class Robot:
    """A new robot with a deployment, whose base is on another computer: not set up, as the doctor looks at what runs."""

    def __init__(self, folder: Path, network: Network, ends: ExitStack) -> None:
        self.root, self.ends = folder / "rover", ends
        for path, text in files_of("rover").items():
            (self.root / path).parent.mkdir(parents=True, exist_ok=True)
            (self.root / path).write_text(text, encoding="utf-8")
        generated = self.root / ".alula/generated"
        generated.mkdir(parents=True)
        (generated / "rover_bridge.yaml").write_text(bridge_configuration(load_robot(self.root / "skillsets")), encoding="utf-8")
        self.base, self.here, self.network = network.computer("base"), network.here("decision"), network
        network.wait_reached(self.here, self.base)
        self.claim = claim_domain()
        ends.callback(self.claim.release)
        self.deploy()

    def deploy(self, *, address: str = "", discovery: str = "LOCALHOST", master: str = "") -> None:
        """Write the deployment's file."""
        values = {"address": address or self.here.address, "discovery": discovery, "master": master or f"{self.base.address}:11311"}
        (self.root / "deployments/robot.yaml").write_text(FILE.format(domain=self.claim.domain, **values), encoding="utf-8")

    def run(self, computer: Computer, *words: str, **variables: str) -> subprocess.Popen[bytes]:
        """Start a process of ROS 1 on a computer."""
        environment = {**computer.ros1_environment(self.base), **variables}
        command = computer.command(str(ROOT / "setup/in_ros1"), *words)
        process = subprocess.Popen([*END_WITH_PARENT, *command], env=environment, start_new_session=True, stdout=subprocess.DEVNULL)
        self.ends.callback(end_process, process)
        return process

    def master_of(self) -> ServerProxy:
        """Return the base's master; it is started where it does not run."""
        master = ServerProxy(f"http://{self.base.address}:11311")
        self.run(self.base, "rosmaster", "--core", "-p", "11311")

        def answers() -> bool:
            try:
                master.getPid("/test")
            except OSError:
                return False
            return True

        until(answers, "the master answers")
        return master

    def doctor(self) -> tuple[int, list[dict[str, str]]]:
        """Return its exit code and what it has found."""
        environment = {**os.environ, "ALULA_ROOT": str(ROOT), "ALULA_ROBOT": str(self.root), "ALULA_ROBOT_STATE": str(self.root / ".alula")}
        words = self.here.command(str(ROOT / "setup/in_ros2"), "python", "-m", "alula_flight.doctor", "robot", "--json")
        done = subprocess.run(words, env=environment, cwd=self.root, capture_output=True, text=True, check=False)
        assert done.returncode in {0, 1}, done.stderr
        return done.returncode, json.loads(done.stdout)["findings"]


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    with ExitStack() as ends, Network() as network, ends:
        yield Robot(tmp_path, network, ends)


def problems(found: list[dict[str, str]]) -> list[str]:
    """Return what has to be mended; each problem has a remedy."""
    assert all(one["remedy"] for one in found if one["level"] == "problem")
    return [f"{one['area']}: {one['what']}" for one in found if one["level"] == "problem"]


def nodes_of(master: ServerProxy, topic: str) -> list[str]:
    """Return who publishes or subscribes to a topic."""
    publishers, subscribers, _ = master.getSystemState("/test")[2]  # type: ignore[index, misc]
    return [node for entries in (publishers, subscribers) for name, nodes in entries if name == topic for node in nodes]


def test_a_base_without_a_fault_and_one_with_many(robot: Robot) -> None:
    master = robot.master_of()
    good = robot.run(robot.base, "python3", str(NODE), "odometry=20", "wheels", "reporter")
    until(lambda: len({*nodes_of(master, "/rover/odom"), *nodes_of(master, "/rover/reported")}) == 1, "the base's node is there")
    code, found = robot.doctor()
    assert (code, problems(found)) == (0, []), found
    told = " ".join(one["what"] for one in found)
    assert "the master's computer reaches this one" in told
    assert re.search(r"\b(\d+) of \1 topics, services and actions are as the bridge needs them", told)
    assert "DDS's profile binds to 127.0.0.1" in told

    nodes = [str(*nodes_of(master, "/rover/odom"))]
    good.send_signal(signal.SIGKILL)
    good.wait()
    for words, variables in (
        (["odometry=20"], {"ROS_IP": "127.0.0.1"}),
        (["odometry=20"], {"ROS_HOSTNAME": "in_the_cellar", "ROS_IP": ""}),
        (["other_odometry"], {}),
        (["odometry=0.5"], {}),
        (["states"], {}),
    ):
        topic = "/rover/resource_states" if words == ["states"] else "/rover/odom"
        robot.run(robot.base, "python3", str(NODE), *words, **variables)
        nodes.append(newcomer(master, topic, nodes))
    dead, loopback, unnamed, other, slow, states = nodes
    with managers(robot.claim.domain, "first", "second"):
        code, found = robot.doctor()
    often = re.compile(r"sends it every [\d.]+ s|has sent it once within 3 s")
    wrong = [often.sub("is slow", one) for one in problems(found)]
    expected = [
        f"ROS 1 nodes: {dead} announced as {robot.base.address}, where nothing listens any more: it died without telling the master",
        f"ROS 1 nodes: {loopback} announced as 127.0.0.1, where no other computer reaches it",
        f"ROS 1 nodes: {unnamed} announced as in_the_cellar, which is not known here",
        f"bindings: /rover/odom: {other} has another version of nav_msgs/Odometry (MD5 00000000, here cd5e73d1)",
        f"bindings: /rover/odom: {slow} is slow, and data rover.odometry is to come every 0.5 s: it would be stale",
        f"bindings: {SILENT}",
        f"ROS 2: rover has 2 managers in domain {robot.claim.domain} (/first, /second): each takes requests",
    ]
    # Nodes have their process ids in their names, and come in the order of these names.
    assert (code, sorted(wrong)) == (1, sorted(expected))
    assert list(dict.fromkeys(one.partition(":")[0] for one in wrong)) == ["ROS 1 nodes", "bindings", "ROS 2"]
    (remedy,) = [one["remedy"] for one in found if one["what"] == SILENT]
    assert remedy.startswith(f"the package resource_reporter of {states} is an older one: ")


def newcomer(master: ServerProxy, topic: str, known: list[str]) -> str:
    """Wait for another node at a topic, and return its name."""
    until(lambda: set(nodes_of(master, topic)) - set(known), f"a node is at {topic}")
    (node,) = set(nodes_of(master, topic)) - set(known)
    return node


@contextmanager
def managers(domain: int, *names: str) -> Iterator[None]:
    """Have nodes of ROS 2 show the states of the skillset rover, as managers do."""
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    nodes = [rclpy.create_node(name, context=context) for name in names]
    for node in nodes:
        node.create_publisher(ResourceStates, "/rover/resource_states", 1)
    try:
        yield
    finally:
        for node in nodes[:-1]:
            node.destroy_node()
        leave(nodes[-1])


def test_nothing_that_is_needed_and_what_has_another_type(robot: Robot) -> None:
    master = robot.master_of()
    code, found = robot.doctor()
    assert (code, problems(found)) == (
        1,
        [
            "bindings: /rover/cmd_vel: no node in ROS 1 subscribes to it",
            "bindings: /rover/odom: no node in ROS 1 publishes it (data rover.odometry)",
            f"bindings: {SILENT}",
        ],
    )
    robot.run(robot.base, "python3", str(NODE), "odometry=0.001", "wheels=Bool")
    until(lambda: nodes_of(master, "/rover/cmd_vel"), "the wheels are there")
    (node,) = nodes_of(master, "/rover/cmd_vel")
    wrong = f"it is std_msgs/Bool in ROS 1 ({node}), and geometry_msgs/Twist in the bridge's configuration"
    assert problems(robot.doctor()[1]) == [
        f"bindings: /rover/cmd_vel: {wrong}",
        f"bindings: /rover/odom: {node} has sent nothing within 3 s, and data rover.odometry is to come every 0.5 s",
        f"bindings: {SILENT}",
    ]


def test_a_master_that_is_silent_shut_or_elsewhere(robot: Robot) -> None:
    code, found = robot.doctor()
    uri = f"http://{robot.base.address}:11311"
    assert (code, problems(found)) == (1, [f"ROS 1 master: no ROS master at {uri}: Connection refused"])
    assert [one["remedy"] for one in found if one["area"] == "ROS 1 master"] == [
        f"start roscore on {robot.base.address}, or correct the port 11311 of `ros1: master`"
    ]
    with robot.network.cut(robot.base, robot.here):
        assert problems(robot.doctor()[1]) == [f"ROS 1 master: no ROS master at {uri}: nothing answers within 3 s"]
    robot.deploy(master="in_the_cellar:11311")
    assert problems(robot.doctor()[1]) == [
        "names: the master's computer, in_the_cellar, is not known here",
        "ROS 1 master: no ROS master at http://in_the_cellar:11311: the name of its computer is not known here",
    ]


def test_the_way_back(robot: Robot) -> None:
    """An address of ours to which the base knows no way."""
    robot.master_of()
    robot.here.ip("address", "add", "172.29.253.9/32", "dev", robot.here.interface)
    deployment = Deployment("robot", robot.root / "robot.yaml", master=f"http://{robot.base.address}:11311", address="172.29.253.9")
    lost = look_at_way_back(deployment)
    assert (lost.level, lost.what) == (
        Level.PROBLEM,
        "the master's computer does not reach this one at 172.29.253.9: no topic would come",
    )
    assert lost.remedy == f"ping 172.29.253.9 on {robot.base.address}; a firewall here?"
    assert read_base(deployment.master).uris == {}, "nothing is left of us at the master"


# --- names, DDS, clocks -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "peers", "told"),
    [
        ("127.0.0.1", (), []),
        ("192.0.2.7", (), ["`address: 192.0.2.7` is no address of this computer"]),
        ("in_the_cellar", (), ["`address: in_the_cellar` is not known here"]),
        ("127.0.0.1", ("in_the_cellar",), ["the peer, in_the_cellar, is not known here"]),
    ],
)
def test_names_that_lead_nowhere(address: str, peers: tuple[str, ...], told: list[str]) -> None:
    found = list(look_at_names(Deployment("lab", Path("lab.yaml"), address=address, peers=peers)))
    assert [one.what for one in found if one.level is Level.PROBLEM] == told
    assert all(one.remedy for one in found if one.level is Level.PROBLEM)


def test_a_name_of_this_computer_that_is_loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    """As Debian writes it into /etc/hosts."""
    known = {"decision": "127.0.1.1", "127.0.0.1": "127.0.0.1", "base": "127.0.1.1"}
    monkeypatch.setattr("alula_flight.doctor.names.resolved", lambda host: known[host])
    found = look_at_names(Deployment("lab", Path("lab.yaml"), master="http://base:11311", address="decision"))
    assert [one.what for one in found] == [
        "`address: decision` is 127.0.1.1 here: our nodes would listen where no other computer reaches them",
        "the master's computer, base, is 127.0.1.1 here, which no other computer reaches",
    ]


@pytest.mark.parametrize(
    ("address", "discovery", "peers", "level", "told"),
    [
        ("127.0.0.1", Discovery.LOCALHOST, (), Level.OK, "it stays on this computer"),
        ("127.0.0.1", Discovery.SUBNET, (), Level.PROBLEM, "but DDS's profile binds to 127.0.0.1: nobody else is ever found"),
        ("10.0.0.2", Discovery.OFF, ("10.0.0.3",), Level.OK, "DDS binds to 127.0.0.1, 10.0.0.2"),
        ("10.0.0.2", Discovery.OFF, (), Level.PROBLEM, "without `peers`"),
    ],
)
def test_how_far_dds_reaches(address: str, discovery: Discovery, peers: tuple[str, ...], level: Level, told: str) -> None:
    deployment = Deployment("lab", Path("lab.yaml"), address=address, discovery=discovery, peers=peers)
    usual = (ROOT / "bridge/fastdds.xml").read_text(encoding="utf-8")
    profile = usual if discovery is Discovery.LOCALHOST else network_profile(deployment, usual)
    last = list(dds.look_at_reach(deployment, profile))[-1]
    assert last.level is level
    assert told in last.what


def test_multicast_of_an_interface_that_does_not_take_it() -> None:
    with Network() as network:
        network.computer("base")
        here = network.here()
        assert dds.look_at_multicast(here.address).level is Level.OK
        here.ip("link", "set", here.interface, "multicast", "off")
        off = dds.look_at_multicast(here.address)
    assert (off.level, off.what) == (Level.PROBLEM, f"{here.interface} does not take multicast: no other computer is found")


def test_a_manager_that_runs_and_is_not_seen() -> None:
    (found,) = dds.look_at_servers({"rover": [], "arm": []}, {"rover"}, 7)
    assert found.what == "the managers of rover run here, and are not seen in domain 7"


def test_shared_memory_without_room(tmp_path: Path) -> None:
    assert dds.look_at_shared_memory(2, tmp_path / "nowhere").level is Level.PROBLEM
    assert dds.look_at_shared_memory(10**6, tmp_path).level is Level.PROBLEM
    assert dds.look_at_shared_memory(2, tmp_path).level is Level.OK


@given(ahead_s=st.floats(-1e4, 1e4), call_s=st.floats(1e-4, 0.02), start_s=st.floats(1e9, 2e9))
def test_the_offset_of_a_clock_of_whole_seconds(ahead_s: float, call_s: float, start_s: float) -> None:
    """The other clock is read in the middle of a call, or at its very end: what is told has the true offset in it."""
    now_s = start_s

    def second() -> int:
        nonlocal now_s
        now_s += call_s
        return math.floor(now_s + ahead_s)

    def pause(for_s: float) -> None:
        nonlocal now_s
        now_s += for_s

    offset = offset_of(second, lambda: now_s, pause)
    assert offset is not None
    assert abs(offset.ahead_s - ahead_s) <= offset.within_s + 1e-6
    assert offset.within_s <= 2.0 * call_s + 0.021


@pytest.mark.parametrize(("ahead_s", "level"), [(0.0, Level.OK), (-0.4, Level.PROBLEM), (3600.0, Level.PROBLEM)])
def test_the_clock_of_another_computer(ahead_s: float, level: Level) -> None:
    """A server that tells its time as Python's do, and so a ROS master."""

    class Handler(SimpleXMLRPCRequestHandler):
        protocol_version = "HTTP/1.1"

        def date_time_string(self, timestamp: float | None = None) -> str:
            return super().date_time_string(math.floor(time.time() + ahead_s))  # noqa: TID251 - it compares wall clocks

    with SimpleXMLRPCServer(("127.0.0.1", 0), Handler, logRequests=False) as server:
        server.register_function(lambda _caller: (1, "", 7), "getPid")
        threading.Thread(target=server.serve_forever, daemon=True).start()
        found = clock.look_at_clock(f"http://127.0.0.1:{server.server_address[1]}")
        server.shutdown()
    assert found.level is level, found
    words = re.fullmatch(r"the clock of the master's computer is ([\d.]+) s (ahead of|behind) ours \(within ([\d.]+) s\)", found.what)
    assert words is not None
    told_s = float(words[1]) * (1.0 if words[2] == "ahead of" else -1.0)
    assert abs(told_s - ahead_s) <= float(words[3]) + 0.002


def test_the_disk(tmp_path: Path) -> None:
    robot = RobotFolder(tmp_path, "rover", tmp_path / "skillsets", tmp_path / "scenarios", tmp_path / "worlds")
    places = Places(ROOT, tmp_path / ".alula", tmp_path / ".alula/up/lab")
    places.bags.mkdir(parents=True)
    deployment = Deployment("lab", tmp_path / "lab.yaml", disk_gb=0.1)
    assert [one.level for one in look_at_disk(deployment, places, robot)] == [Level.OK]
    with (places.bags / "old.bag").open("wb") as bag:
        bag.truncate(95_000_000)
    (full,) = look_at_disk(deployment, places, robot)
    assert full.what.endswith("the oldest go next")
    assert (places.bags / "old.bag").is_file(), "the doctor removes nothing"
    (small,) = look_at_disk(replace(deployment, disk_gb=1e6), places, robot)
    assert "is more than there is" in small.what


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--json"], "alula doctor: --json is of a deployment; name one: alula doctor DEPLOYMENT --json"),
        (["labb"], "alula: there is no deployment 'labb' in"),  # before the doctor is started
        (["robot", "more"], "alula doctor: there is no argument more"),
    ],
)
def test_what_can_not_be_looked_at(words: list[str], why: str) -> None:
    done = subprocess.run([str(ROOT / "alula"), "doctor", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(why)
