"""Processes around the bridge for its live tests: a ROS master, the bridge itself, ROS 1 peers."""

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest

from alula_testing.waits import HANGS_S, until

HERE = Path(__file__).resolve().parent
PROBE_S = 0.05  # between messages that are sent until the first of them arrives


def alula_root() -> Path:
    return Path(os.environ["ALULA_ROOT"])


def bag_folder() -> Path:
    """Return the folder of recordings made by others, beside the checkout; ALULA_DATA names another place."""
    return Path(os.environ.get("ALULA_DATA", alula_root().parent / "shared" / "data")) / "bags"


def end(process: subprocess.Popen, within_s: float = 5.0) -> float:
    """Interrupt a process group, and return how many seconds it took to end."""
    start = time.monotonic()
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(within_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    return time.monotonic() - start


RUNNING: list["Master | Lines"] = []  # a test that fails half-way must leave no process behind in its domain


class Master:
    def __init__(self, port: int) -> None:
        self.port = port
        self.uri = f"http://127.0.0.1:{port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1"}
        self.process: subprocess.Popen | None = None
        RUNNING.append(self)

    def start(self) -> None:
        command = [str(alula_root() / "setup/in_ros1"), "rosmaster", "--core", "-p", str(self.port)]
        self.process = subprocess.Popen(command, env=self.environment, start_new_session=True, stdout=subprocess.DEVNULL)
        until(self.answers, "the ROS master answers")

    def answers(self) -> bool:
        try:
            ServerProxy(self.uri).getPid("/bridge_test")
        except OSError:
            return False
        return True

    def close(self) -> None:
        if self.process is not None:
            end(self.process)


class Lines:
    """A process whose output is read line by line as it comes."""

    def __init__(self, command: list[str], environment: dict[str, str], *, errors: bool) -> None:
        self.process = subprocess.Popen(
            command,
            env=environment,
            start_new_session=True,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL if errors else subprocess.PIPE,
            stderr=subprocess.PIPE if errors else None,
        )
        RUNNING.append(self)
        self.lines: list[str] = []
        self._stream = self.process.stderr if errors else self.process.stdout
        self._fresh: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in self._stream:
            self.lines.append(line.rstrip("\n"))
            self._fresh.put(line)

    def close(self) -> float:
        """End the process, and return how many seconds it took."""
        return end(self.process)

    def next_line(self, within_s: float) -> str:
        return self._fresh.get(timeout=within_s)


class Ros1Peer(Lines):
    def __init__(self, master: Master, script: str = "ros_bridge_ros1_peer.py", *, enter: Sequence[str] = ()) -> None:
        """``enter`` are the words that run a command on another computer."""
        command = [*enter, str(alula_root() / "setup/in_ros1"), "python3", str(HERE / script)]
        super().__init__(command, master.environment, errors=False)
        self.expect("ready")

    def close(self) -> float:
        """Close its input, at which it ends."""
        self.process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(2.0)
        return super().close()

    def do(self, command: str, **arguments: object) -> None:
        self.process.stdin.write(json.dumps({"do": command, **arguments}) + "\n")
        self.process.stdin.flush()

    def expect(self, *kinds: str, within_s: float = HANGS_S, **wanted: object) -> dict:
        """Return the next event of one of the kinds that has the wanted values; others in between are passed over."""
        deadline = time.monotonic() + within_s
        passed_over: list[str] = []
        while True:
            try:
                line = self.next_line(max(deadline - time.monotonic(), 0.001))
            except queue.Empty:
                pytest.fail(f"no {kinds} {wanted} from the ROS 1 peer within {within_s} s, but {''.join(passed_over[-10:]) or 'nothing'}")
            event = json.loads(line)
            if event["event"] in kinds and all(event.get(key) == value for key, value in wanted.items()):
                return event
            passed_over.append(line)


class BridgeProcess(Lines):
    def __init__(
        self,
        master: Master,
        folder: Path,
        config: str,
        *arguments: str,
        program: Sequence[str] = ("-m", "ros_bridge"),
        enter: Sequence[str] = (),
    ) -> None:
        folder.mkdir(exist_ok=True, parents=True)
        (folder / "bridge.yaml").write_text(config)
        self.stats_file = folder / "bridge_stats.json"
        command = [sys.executable, *program, "--config", str(folder / "bridge.yaml"), "--stats", str(self.stats_file), *arguments]
        super().__init__([*enter, *command, f"__log:={folder}/bridge.log"], master.environment, errors=True)

    def wait_running(self) -> None:
        until(lambda: any("bridging" in line for line in self.lines), f"the bridge runs: {self.lines}")
