"""The managers of several skillsets in one process: one participant in DDS, and each skillset by itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("mapping_interfaces.action")

from rclpy.node import Node
from skillset_ros2_rig import READY_S, SOON_S, until

from alula.common.fast_dds import SMALL_SEGMENT_BYTES
from alula.common.shared_memory import PORTS
from alula.model.execution_state import ExecutionState
from skillset_ros2 import SkillsetClient

S = ExecutionState
BOTH = ("mapping=skillset_ros2_factories:mapping", "navigation=skillset_ros2_factories:navigation")
SKILL = "lidar_mapping"


def start(*words: str, **options) -> subprocess.Popen:
    """Start managers with the factories of this folder."""
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "skillset_ros2.managers", *words]
    return subprocess.Popen(command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, text=True, **options)


class Together:
    """A process of managers, what its hooks tell, and clients of both skillsets."""

    def __init__(self, spinning, *words: str) -> None:
        self.process = start(*BOTH, *words, stderr=subprocess.STDOUT)
        self.told: list[str] = []
        threading.Thread(target=lambda: self.told.extend(self.process.stdout), daemon=True).start()
        node = spinning.spin(Node(f"together_{os.getpid()}_{self.process.pid}"))
        self.clients = {name: SkillsetClient(node, name) for name in ("mapping", "navigation")}
        for client in self.clients.values():
            assert client.wait_ready(READY_S), client.missing

    @property
    def said(self) -> str:
        """Return what the process has said so far."""
        return "".join(self.told)

    def maps(self):
        """Return an execution that runs until it is ended."""
        handle = self.clients["mapping"].start(SKILL)
        until(lambda: handle.state is S.RUNNING, f"{handle} runs")
        return handle


@pytest.fixture
def together(request, spinning):
    pair = Together(spinning, *getattr(request, "param", ()))
    yield pair
    pair.process.kill()
    pair.process.wait()


def test_one_process_serves_both_and_at_its_end_stops_what_runs_and_tells_the_caller(together):
    handle = together.maps()
    together.process.send_signal(signal.SIGTERM)
    assert handle.wait(SOON_S)
    assert (handle.state, "shut down" in handle.message) == (S.FAILED, True)
    assert together.process.wait(SOON_S) == 0
    until(lambda: any(line.startswith(f"stopped {SKILL}") for line in together.told), "the function is stopped")


def own_segments(pid: int) -> dict[str, int]:
    """Return the sizes, bytes, of the segments of shared memory that a participant of this process has made: it holds their locks."""
    held = [str(one.readlink()) for one in Path(f"/proc/{pid}/fd").iterdir()]
    names = [Path(path.removesuffix("_el")) for path in held if path.endswith("_el") and not Path(path).name.startswith(PORTS)]
    return {path.name: path.stat().st_size for path in names}


def test_it_has_one_participant_with_little_shared_memory(together):
    segments = own_segments(together.process.pid)  # that of the profile, and one that Fast DDS makes of half a megabyte
    assert SMALL_SEGMENT_BYTES <= sum(segments.values()) < 1.2 * SMALL_SEGMENT_BYTES, segments


@pytest.mark.parametrize("together", [("--ros-args", "-p", "navigation:raises_s:=2.0")], indirect=True)
def test_a_callback_that_raises_fails_what_runs_of_its_own_skillset_only(together):
    mapping = together.maps()
    until(lambda: "a callback of navigation went wrong" in together.said, "it raises")
    mapping.interrupt()
    assert mapping.wait(SOON_S)
    assert mapping.state is S.INTERRUPTED
    refused = together.clients["navigation"].start("goto_straight", target=(1, 2, 3), speed=1)
    assert refused.wait(SOON_S)
    assert refused.state is S.NOT_READY


@pytest.mark.parametrize("together", [("--processes", "separate")], indirect=True)
def test_each_skill_of_both_may_have_a_process_of_its_own(together):
    assert together.maps().state is S.RUNNING
    together.process.send_signal(signal.SIGTERM)
    assert together.process.wait(3 * SOON_S) == 0


def test_managers_of_one_that_are_there_already_keep_all_from_being_served(together):
    other = start("mapping=skillset_ros2_factories:mapping", stderr=subprocess.PIPE)
    _, said = other.communicate(timeout=READY_S)
    assert (other.returncode, "managers of mapping are there already" in said) == (2, True)
    assert together.maps().state is S.RUNNING


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "write SKILLSET=MODULE:FACTORY for each skillset"),
        (("maping=skillset_ros2_factories:mapping",), "maping: there is no maping_managers"),
        (
            ("mapping=skillset_ros2_factories:maping",),
            "mapping=skillset_ros2_factories:maping: skillset_ros2_factories has no function maping",
        ),
        (("mapping=nowhere:mapping",), "mapping=nowhere:mapping: No module named 'nowhere'"),
        ((*BOTH, "--part", "resources"), "--part"),
    ],
)
def test_what_can_not_be_served_is_told_with_the_code_2(words, told):
    process = start(*words, stderr=subprocess.PIPE)
    _, said = process.communicate(timeout=READY_S)
    assert (process.returncode, told in said) == (2, True), said
