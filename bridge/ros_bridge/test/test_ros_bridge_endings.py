"""The bridge as a process from its beginning to its end: signals, wrong configurations, a master that is not there yet or restarts."""

import json
import signal
from xmlrpc.client import ServerProxy

from diagnostic_msgs.msg import DiagnosticArray
from ros_bridge_harness import BridgeProcess, Master, Ros1Peer
from ros_bridge_nodes import Ros2Peer, open_up
from std_msgs.msg import String

from alula.common.network import free_port
from alula_testing.waits import HANGS_S, until
from ros_bridge.node import LOOKS_A_STATS_FILE


def test_interrupt_ends_the_bridge_with_its_figures(master, ros2_domain, tmp_path):
    config = "topics:\n  - {name: /bt_end, direction: ros1_to_ros2, type: std_msgs/String}\n"
    for number in (signal.SIGINT, signal.SIGTERM):
        process = BridgeProcess(master, tmp_path / number.name, config)
        process.wait_running()
        process.process.send_signal(number)
        assert process.process.wait(HANGS_S) == 0
        about = {"ros2_name": "/bt_end", "direction": "ros1_to_ros2", "type": "std_msgs/String", "rate_hz": 0.0}
        figures = {"count": 0, "bytes": 0, "p50_ms": None, "p95_ms": None, "dropped": 0, "errors": 0, "dropped_why": {}}
        assert json.loads(process.stats_file.read_text()) == {"topics": {"/bt_end": about | figures}, "services": {}, "actions": {}}


def test_figures_are_written_where_they_have_changed_or_are_gone(master, ros2_domain, tmp_path):
    process = BridgeProcess(master, tmp_path, "topics:\n  - {name: /bt_kept, direction: ros1_to_ros2, type: std_msgs/String}\n")
    process.wait_running()
    ros2 = Ros2Peer()
    looks = ros2.subscribe("/diagnostics", DiagnosticArray)
    until(process.stats_file.is_file, "they are written")
    written_ns, before = process.stats_file.stat().st_mtime_ns, len(looks)
    until(lambda: len(looks) > before + 2 * LOOKS_A_STATS_FILE, "they are looked at again")
    assert process.stats_file.stat().st_mtime_ns == written_ns
    process.stats_file.unlink()
    until(process.stats_file.is_file, "they are written again")
    ros2.tidy()
    ros2.close()
    assert process.close() < 5.0


WITHOUT_ROS1 = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"rospy", "rosgraph", "roslib", "genpy", "rospkg", "actionlib"}:
            raise ImportError(f"the bridge imports {name}")
sys.meta_path.insert(0, Refuse())
from ros_bridge.cli import entry
entry()
"""


def test_bridge_is_one_node_of_each_world_and_imports_no_ros1(ros2_domain, master, tmp_path):
    config = "discover: {all: true, parameters: true}\nactions:\n  - {name: /bt_count, server: ros2, type: bridge_test_interfaces/Count}\n"
    process = BridgeProcess(master, tmp_path, config, program=("-c", WITHOUT_ROS1))
    process.wait_running()
    ros2, peer = Ros2Peer(), Ros1Peer(master)
    received = open_up(peer, ros2, "/bt_without", String, "std_msgs/String", values={"data": "crosses"})
    assert received[0].data == "crosses"
    peer.do("subscribe", topic="/diagnostics", type="diagnostic_msgs/DiagnosticArray")
    peer.expect("message", topic="/diagnostics")
    state = ServerProxy(master.uri).getSystemState("/t")[2]
    nodes = {node for kind in state for _, nodes in kind for node in nodes if "bridge" in node and "peer" not in node}
    assert nodes == {"/ros_bridge"}

    def own_nodes():
        return sorted(name for name in ros2.node.get_node_names() if name.startswith("ros") and "peer" not in name)

    # Bridges that other tests have killed stay in the domain until their lease ends, after 20 s.
    until(lambda: own_nodes() == ["ros1_parameters", "ros_bridge"], f"one node of ours: {own_nodes()}")
    ros2.tidy()
    ros2.close()
    assert process.close() < 5.0


def test_interrupt_ends_a_bridge_that_waits_for_its_master(ros2_domain, tmp_path):
    no_master = Master(free_port())
    process = BridgeProcess(no_master, tmp_path, "topics: []\n")
    until(lambda: any("waiting for a ROS master" in line for line in process.lines), "it says that it waits")
    process.process.send_signal(signal.SIGTERM)
    assert process.process.wait(2.0) == 0


def test_wrong_configuration_ends_with_2_and_wrong_type_with_1(master, ros2_domain, tmp_path):
    for config, code, words in [
        ("topics:\n  - {nmae: /a}", 2, "bridge.yaml:2: a route has no `nmae`"),
        ("topics:\n  - {name: /a, direction: ros1_to_ros2, type: no_msgs/No}", 1, "no_msgs/No"),
    ]:
        process = BridgeProcess(master, tmp_path / str(code), config)
        assert process.process.wait(20.0) == code
        until(lambda process=process, words=words: any(words in line for line in process.lines), f"{words} in {process.lines}")


def test_waits_for_the_master_with_one_message_and_survives_its_restart(ros2_domain, tmp_path):
    master = Master(free_port())
    process = BridgeProcess(master, tmp_path, "topics:\n  - {name: /bt_restart, direction: ros1_to_ros2, type: std_msgs/String}\n")
    until(lambda: process.lines, "it says that it waits")
    ros2 = Ros2Peer()
    master.start()
    process.wait_running()
    assert sum("waiting for a ROS master" in line for line in process.lines) == 1
    master.close()
    until(lambda: any("does not answer" in line for line in process.lines), "it notices")
    master.start()
    peer = Ros1Peer(master)
    received = open_up(peer, ros2, "/bt_restart", String, "std_msgs/String", values={"data": "after the restart"})
    assert received[0].data == "after the restart"
    peer.close()
    assert process.close() < 2.0
    ros2.tidy()
    ros2.close()
    master.close()
