"""The bridge's ROS 1 node without ROS 1: its name, connection headers, its words with a master that is no good."""

import contextlib
import socket
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_bridge.addresses import bind_address, in_uri, resolve
from ros_bridge.errors import WireError
from ros_bridge.master import Connection, MasterMonitor, RefusedError, value_of
from ros_bridge.ros1_node import Kind, Ros1Node, own_name
from ros_bridge.tcpros import decode_header, encode_header

NAMES = st.text(st.characters(codec="utf-8", exclude_characters="="), min_size=1, max_size=20)
OK_ANSWER = (
    "<?xml version='1.0'?><methodResponse><params><param><value><array><data>{}</data></array></value></param></params></methodResponse>"
)


@pytest.mark.parametrize(
    ("arguments", "namespace", "name"),
    [
        ([], "", "/ros_bridge"),
        (["--all", "__name:=other", "__log:=/tmp/x.log"], "", "/other"),
        (["__ns:=/robot/"], "", "/robot/ros_bridge"),
        ([], "robot", "/robot/ros_bridge"),
    ],
)
def test_name_is_what_roslaunch_says(arguments, namespace, name, monkeypatch):
    monkeypatch.setenv("ROS_NAMESPACE", namespace)
    assert own_name(arguments) == name


def test_a_node_that_is_reached_by_loopback_listens_there_only():
    hosts = ("localhost", "127.0.0.1", "::1", "robot", "fd00::5")
    assert [bind_address(host) for host in hosts] == ["127.0.0.1", "127.0.0.1", "::1", "0.0.0.0", "::"]  # noqa: S104


def test_a_node_listens_on_addresses_of_both_kinds_where_ros_is_told_to(monkeypatch):
    monkeypatch.setenv("ROS_IPV6", "on")
    assert [bind_address(host) for host in ("127.0.0.1", "robot")] == ["127.0.0.1", "::"]


def test_addresses_of_a_name_are_those_of_ipv4_first(monkeypatch):
    found = [(family, 1, 6, "", (address, 5)) for family, address in ((socket.AF_INET6, "fd00::5"), (socket.AF_INET, "10.0.0.5"))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_: [*found, *found])
    assert resolve("robot", 5) == ["10.0.0.5", "fd00::5"]


def test_an_address_of_ipv6_stands_in_brackets_in_a_uri():
    assert [in_uri(host) for host in ("robot", "10.0.0.5", "fd00::5", "[fd00::5]")] == ["robot", "10.0.0.5", "[fd00::5]", "[fd00::5]"]


@given(st.dictionaries(NAMES, st.text(max_size=40), max_size=5))
def test_connection_headers_return(fields):
    assert decode_header(encode_header(fields)[4:]) == fields


@given(st.binary(max_size=60))
def test_garbage_is_a_header_or_an_error(data):
    with contextlib.suppress(WireError):
        assert isinstance(decode_header(data), dict)


@pytest.mark.parametrize("answer", [b"", b"<xml", b"\xff", OK_ANSWER.format("").encode()])
def test_answer_that_is_none_is_an_error_of_its_sender(answer):
    with pytest.raises(OSError, match="http://x"):
        value_of(answer, "http://x")


def test_address_that_is_none_is_an_error():
    with pytest.raises(OSError, match="no address of a node"):
        Connection("http://x:port")


class FakeMaster(Connection):
    """Answers from a table, counts what it is asked, and is away while ``away`` is set."""

    def __init__(self):
        super().__init__("http://fake:1")
        self.asked, self.away, self.publishers = [], False, ["http://peer:1/"]
        self.system = b"<string>/ros_bridge</string>"

    def call_raw(self, method, *arguments):
        if self.away:
            raise OSError("away")
        return self.system

    def call(self, method, *arguments):
        if self.away:
            raise OSError("away")
        self.asked.append((method, *arguments[1:]))
        if method == "lookupService":
            raise RefusedError("no provider")
        return self.publishers


@pytest.fixture
def node():
    changed = []
    master = FakeMaster()
    node = Ros1Node("/ros_bridge", master, host="127.0.0.1", topics_port=7, changed=lambda *words: changed.append(words))
    node.told, node.master = changed, master
    yield node
    node.close()


def test_what_two_routes_share_is_unregistered_with_the_second(node):
    for _ in range(2):
        node.register(Kind.SUBSCRIBER, "/a", "std_msgs/String")
    assert node.told == [("/a", ["http://peer:1/"])] * 2
    node.unregister(Kind.SUBSCRIBER, "/a", "std_msgs/String")
    assert node.topics(Kind.SUBSCRIBER) == [["/a", "std_msgs/String"]]
    assert not [asked for asked in node.master.asked if asked[0].startswith("unregister")]
    node.unregister(Kind.SUBSCRIBER, "/a", "std_msgs/String")
    assert node.master.asked[-1] == ("unregisterSubscriber", "/a", node.uri)
    assert node.topics(Kind.SUBSCRIBER) == []


def test_what_the_master_has_not_heard_it_hears_later(node):
    master = node.master
    node.register(Kind.PUBLISHER, "/told", "std_msgs/String")
    master.away = True
    node.register(Kind.SERVICE, "/untold")
    master.away = False
    before = len(master.asked)
    node.register_again(only_untold=True)
    assert master.asked[before:] == [("registerService", "/untold", "rosrpc://127.0.0.1:7", node.uri)]
    node.register_again()
    assert [asked[0] for asked in master.asked[before + 1 :]] == ["registerPublisher", "registerService"]
    assert node.place_of_service("/unserved") is None


def test_parameters_are_read_at_first_when_told_and_after_a_restart(node):
    changed = []
    node.subscribe_parameters(lambda: changed.append(1))
    assert ("subscribeParam", node.uri, "/") in node.master.asked
    with socket.create_connection(("127.0.0.1", int(node.uri.rpartition(":")[2].rstrip("/")))):
        pass  # a peer that says nothing does no harm
    assert Connection(node.uri).call("getPid", "/peer") > 0
    Connection(node.uri).call("paramUpdate", "/master", "/rate", 5)
    node.register_again()
    assert len(changed) == 3


def test_shutdown_ends_the_bridge(node):
    ended = threading.Event()
    node.on_shutdown = ended.set
    Connection(node.uri).call("shutdown", "/master", "another node has this name")
    assert ended.is_set()


class Told:
    """A node that notes how it is told to register again."""

    name = "/ros_bridge"

    def __init__(self):
        self.told = []

    def register_again(self, *, only_untold=False):
        self.told.append(only_untold)


def test_monitor_tells_loss_return_restart_and_change():
    master, node, events = FakeMaster(), Told(), []
    monitor = MasterMonitor(master, node)
    monitor.on_reachable = lambda: events.append(monitor.state.reachable)
    monitor.on_graph = lambda: events.append("graph")
    master.system = OK_ANSWER.format(
        "<value><int>1</int></value><value><string></string></value><value><array><data><value><string>/ros_bridge</string></value>"
        "</data></array></value>"
    ).encode()
    forgotten = master.system.replace(b"/ros_bridge", b"/other")
    known = master.system
    for system, away in ((known, False), (known, False), (known, True), (known, True), (known, False), (forgotten, False), (known, False)):
        master.system, master.away = system, away
        monitor.look()
    assert events == ["graph", False, True, "graph", "graph"]
    assert node.told == [True, True, True, False, True]
    assert (monitor.state.reachable, monitor.state.losses) == (True, 2)
