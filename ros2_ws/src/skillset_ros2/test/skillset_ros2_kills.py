"""Kills manager processes at random moments of a mission of executions: ``python skillset_ros2_kills.py [ROUNDS] [SEED]``.

In each round executions follow one another, a process of the skillset ``mapping`` gets SIGKILL at a random moment, and each
handle has to end with an outcome and a reason within ``END_S``; then the skill has to run again. Prints a line a round.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from alula.model.execution_state import ExecutionState
from skillset_ros2 import SkillsetClient

SKILL = "lidar_mapping"
PARTS = ("resources", SKILL)
END_S = 30.0
READY_S = 60.0
LASTS_S = 0.25


@dataclass(frozen=True)
class Kill:
    """What a kill did: the handle that was open then (or None), and how long it took to end and to run again."""

    part: str
    outcome: str
    message: str
    ended_s: float
    again_s: float


class Mission:
    """The skillset in separate processes, and a client that goes on whatever happens."""

    def __init__(self, *, lasts_s: float = LASTS_S) -> None:
        environment = os.environ | {"ALULA_TEST_SKILLSET": "mapping", "ALULA_TEST_LASTS_S": str(lasts_s)}
        script = Path(__file__).with_name("skillset_ros2_process.py")
        self.supervisor = subprocess.Popen(
            [sys.executable, script, "--processes", "separate"], env=environment, stdout=subprocess.PIPE, text=True
        )
        self.told: list[str] = []
        threading.Thread(target=lambda: self.told.extend(self.supervisor.stdout), daemon=True).start()
        self.node = Node(f"skill_runtime_killer_{os.getpid()}_{self.supervisor.pid}")
        self.client = SkillsetClient(self.node, "mapping")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()
        assert self.client.wait_ready(READY_S), self.client.missing

    def pid(self, part: str) -> int:
        """The process of a part; waits while it is being restarted."""
        end = time.monotonic() + END_S
        while True:
            for place in Path("/proc").glob("[0-9]*/cmdline"):
                try:
                    words = place.read_bytes().split(b"\0")
                except OSError:
                    continue
                if b"--parent" in words and str(self.supervisor.pid).encode() in words and part.encode() in words:
                    return int(place.parent.name)
            assert time.monotonic() < end, f"no process of {part}"
            time.sleep(0.02)  # /proc gives no notice of new processes

    def run_until(self, moment_s: float):
        """Start one execution after another until this moment (monotonic); return the last."""
        handle = self.client.start(SKILL)
        while (left := moment_s - time.monotonic()) > 0:
            if handle.wait(min(left, 0.1)):
                handle = self.client.start(SKILL)
        return handle

    def runs_again(self) -> float:
        """Wait until an execution ends with its result; how long that took."""
        begun_s = time.monotonic()
        while time.monotonic() - begun_s < READY_S:
            handle = self.client.start(SKILL)
            assert handle.wait(END_S), f"{handle} hangs"
            if handle.state is ExecutionState.TERMINATED:
                return time.monotonic() - begun_s
            time.sleep(0.05)  # managers that are not up yet refuse at once
        raise AssertionError(f"{SKILL} does not run again: {handle} {handle.message}")

    def kill(self, part: str, after_s: float) -> Kill:
        """One round."""
        pid = self.pid(part)
        handle = self.run_until(time.monotonic() + after_s)
        os.kill(pid, signal.SIGKILL)
        killed_s = time.monotonic()
        assert handle.wait(END_S), f"{handle} hangs after the kill of {part}"
        ended_s = time.monotonic() - killed_s
        assert handle.outcome == "TERMINATED" or handle.message, handle
        return Kill(part, handle.outcome, handle.message, ended_s, self.runs_again())

    def close(self) -> int:
        """End everything; return the supervisor's exit code."""
        self.supervisor.terminate()
        code = self.supervisor.wait(END_S)
        self.executor.shutdown(timeout_sec=5.0)
        self.thread.join(5.0)
        self.node.destroy_node()
        return code


def main() -> None:
    import rclpy

    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    chance = random.Random(int(sys.argv[2]) if len(sys.argv) > 2 else 0)  # noqa: S311
    rclpy.init()
    mission = Mission()
    kills = []
    for number in range(rounds):
        kills.append(mission.kill(chance.choice(PARTS), chance.uniform(0.0, 2.0 * LASTS_S)))
        sys.stdout.write(f"{number + 1}: {kills[-1]}\n")
        sys.stdout.flush()
    ended, again = sorted(kill.ended_s for kill in kills), sorted(kill.again_s for kill in kills)
    sys.stdout.write(
        f"{rounds} kills, every execution ended; s from the kill to the end: p50 {ended[rounds // 2]:.1f}, max {ended[-1]:.1f};"
    )
    sys.stdout.write(f" until it ran again: p50 {again[rounds // 2]:.1f}, max {again[-1]:.1f}; supervisor ended {mission.close()}\n")
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
