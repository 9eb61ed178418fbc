"""What the bridge's live tests stand on: a ROS master, the bridge with the configuration of the test's module, peers in each world."""

import time
from types import SimpleNamespace
from xmlrpc.client import ServerProxy

import pytest
from ros_bridge_action_nodes import ActionNode
from ros_bridge_harness import RUNNING, BridgeProcess, Master, Ros1Peer
from ros_bridge_nodes import Ros2Node, Ros2Peer

from alula.common.network import free_port


@pytest.fixture(scope="module")
def master():
    master = Master(free_port())
    master.start()
    yield master
    master.close()


@pytest.fixture(scope="module")
def bridge(master, ros2_domain, tmp_path_factory, request):
    """Run the bridge with the module's ``CONFIG``, and its ``ARGUMENTS`` where it has some."""
    process = BridgeProcess(master, tmp_path_factory.mktemp("bridge"), request.module.CONFIG, *getattr(request.module, "ARGUMENTS", ()))
    process.wait_running()
    yield process
    ran = process.process.poll() is None
    process.close()
    assert not ran or process.process.returncode == 0, "it ends by itself"


@pytest.fixture(scope="module")
def ros1(bridge, master):
    peer = Ros1Peer(master)
    yield peer
    peer.close()


@pytest.fixture(scope="module")
def ros2_peer(bridge):
    peer = Ros2Peer()
    yield peer
    peer.close()


@pytest.fixture
def ros2(ros2_peer):
    """Give the module's node, spun by a thread of its own; what a test makes of it goes with the test."""
    yield ros2_peer
    ros2_peer.tidy()


@pytest.fixture
def ros2_node(bridge, ros1):
    """Give a node of the test's own, spun while the test waits; discovery sees it come and go."""
    node = Ros2Node(f"peer_{time.monotonic_ns()}")
    yield node
    node.close()


@pytest.fixture(scope="module")
def action_ros1(bridge, master):
    """Give a ROS 1 node that has actionlib's servers and clients."""
    peer = Ros1Peer(master, "ros_bridge_action_peer.py")
    yield peer
    peer.close()


@pytest.fixture(scope="module")
def action_node(bridge):
    node = ActionNode()
    node.thread.start()
    yield node
    node.close()


@pytest.fixture
def action_ros2(action_node):
    """Give a ROS 2 node that has action clients; servers that a test starts go with the test."""
    yield action_node
    action_node.tidy()


@pytest.fixture(autouse=True)
def leave_nothing_running():
    """End the processes that a test has started; those of its module began before, as pytest sets up wider fixtures first."""
    before = list(RUNNING)
    yield
    for process in RUNNING:
        if process not in before:
            process.close()
    RUNNING[:] = before


@pytest.fixture(scope="module")
def world(bridge, master, ros2_peer):
    """Give all that runs: a master, a bridge with the module's ``CONFIG``, and a peer in ROS 2."""
    return SimpleNamespace(master=master, bridge=bridge, ros2=ros2_peer, proxy=ServerProxy(master.uri))


@pytest.fixture(autouse=True)
def tidy(request):
    """End what the test has made of the module's peer in ROS 2."""
    yield
    if "world" in request.fixturenames and "ros2_peer" in request.fixturenames:
        request.getfixturevalue("ros2_peer").tidy()
