"""How a process leaves DDS: its discovery ends before its last node does; and what one that is killed leaves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.context import Context  # noqa: E402
from rclpy.node import Node  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from alula.common import shared_memory  # noqa: E402
from alula.common.fast_dds import leave, stop_discovery  # noqa: E402
from alula_testing.waits import until  # noqa: E402


@pytest.fixture
def alone(ros2_domain):
    """Return a function that makes a node in a context of its own."""
    made = []

    def make(name):
        context = Context()
        rclpy.init(context=context)
        made.append(Node(name, context=context, enable_rosout=False))
        return made[-1]

    yield make
    for node in made:
        if node.context.ok():
            leave(node)


def test_a_node_whose_discovery_has_ended_learns_of_nothing_more(alone):
    speaker, ended, other = (alone(name) for name in ("speaker", "ended", "other"))
    early = speaker.create_publisher(String, "early", 1)
    until(lambda: ended.count_publishers("early") and other.count_publishers("early"), "both know the first publisher")
    assert stop_discovery(ended)
    late = speaker.create_publisher(String, "late", 1)
    speaker.destroy_publisher(early)
    until(lambda: other.count_publishers("late") and not other.count_publishers("early"), "the other has learned of both changes")
    assert (ended.count_publishers("late"), ended.count_publishers("early")) == (0, 1)
    assert stop_discovery(ended), "a second time does nothing"
    speaker.destroy_publisher(late)


def test_others_hear_of_a_node_that_leaves(alone):
    leaving, other = alone("leaving"), alone("other")
    until(lambda: "leaving" in other.get_node_names(), "it is known")
    leave(leaving)
    until(lambda: "leaving" not in other.get_node_names(), "it is gone")
    assert not leaving.context.ok()


NODE = """
import sys, rclpy
rclpy.init()
node = rclpy.create_node("killed")
print("here", flush=True)
sys.stdin.read()
"""


@pytest.mark.usefixtures("ros2_domain")
def test_the_port_of_a_killed_process_is_marked_as_failed_for_those_who_write_to_it(tmp_path, monkeypatch):
    process = subprocess.Popen([sys.executable, "-c", NODE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "here\n"
        opened = {fd.resolve() for fd in Path(f"/proc/{process.pid}/fd").iterdir()}
        locks = [file for file in opened if file.name.startswith(shared_memory.PORTS) and file.name.endswith(shared_memory.LOCK)]
        assert locks, opened
        for lock in locks:
            for file in (lock, lock.with_name(lock.name.removesuffix(shared_memory.LOCK))):
                (tmp_path / file.name).symlink_to(file)
        monkeypatch.setattr(shared_memory, "SHARED_MEMORY", tmp_path)
        assert shared_memory.fail_dead_ports() == 0, "it lives"
    finally:
        process.kill()
        process.communicate()
    assert shared_memory.fail_dead_ports() == len(locks)
    assert shared_memory.fail_dead_ports() == 0, "all are"
