"""Run one case of the benchmark: a bridge of its own, an end on each side, and what they report."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import psutil

from alula.common.network import free_port
from alula.common.processes import die_with_parent
from bridge_tools.bench_cases import ROS1_TYPES, Case, ServiceCase, TopicCase, Way
from ros_bridge.errors import BridgeError
from ros_bridge.master import Connection, wait_for_master

WITHIN_S = 60.0
DRAINED_S = 1.0
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
ENDS = Path(__file__).resolve().parent / "bench_ends"


class BenchError(BridgeError):
    """A process of the benchmark does not do what it should."""


class Process:
    """A program that writes lines; ended with its children when the block is left."""

    def __init__(self, command: list[str], environment: Mapping[str, str], *, watch_errors: bool = False) -> None:
        """Start it; the lines are those of standard output, or of standard error."""
        stdout, stderr = (subprocess.DEVNULL, subprocess.PIPE) if watch_errors else (subprocess.PIPE, None)
        self._command = " ".join(command)
        self.started_ns = time.monotonic_ns()
        self._process = subprocess.Popen(
            command,
            env=dict(environment),
            text=True,
            stdin=subprocess.PIPE,
            stdout=stdout,
            stderr=stderr,
            start_new_session=True,
            preexec_fn=die_with_parent,  # noqa: PLW1509  (one prctl, no allocation)
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._read, args=(watch_errors,), daemon=True).start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def _read(self, errors: bool) -> None:  # noqa: FBT001
        for line in (self._process.stderr if errors else self._process.stdout) or ():
            self._lines.put(line)
        self._lines.put(None)

    def line(self, within_s: float = WITHIN_S) -> str:
        """Return the next line. Raises BenchError when none comes."""
        try:
            line = self._lines.get(timeout=within_s)
        except queue.Empty:
            line = None
        if line is None:
            raise BenchError(f"{self._command}: no answer within {within_s:.0f} s, or it has ended")
        return line

    def expect(self, event: str) -> dict[str, Any]:
        """Return the next event of that name."""
        while True:
            found: dict[str, Any] = json.loads(self.line())
            if found["event"] == event:
                return found

    def tell(self, word: str) -> None:
        """Write a line to the process's stdin."""
        if self._process.stdin is not None:
            self._process.stdin.write(word + "\n")
            self._process.stdin.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for number, wait_s in ((signal.SIGTERM, 5.0), (signal.SIGKILL, None)):
            if self._process.poll() is not None:
                return
            os.killpg(self._process.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(wait_s)


@dataclass(frozen=True)
class Usage:
    """What the bridge has taken."""

    cpu_s: float
    peak_mb: float


def usage(pid: int) -> Usage:
    """Return what a process has taken so far."""
    times = psutil.Process(pid).cpu_times()
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")  # psutil does not tell the peak
    return Usage(times.user + times.system, int(status.split("VmHWM:")[1].split()[0]) / 1024)


class Bench:
    """A ROS master and a DDS domain of our own."""

    def __init__(self, master_uri: str, folder: Path) -> None:
        """Use a master that runs."""
        self._folder = folder
        self.environment = {**os.environ, "ROS_MASTER_URI": master_uri, "ROS_IP": "127.0.0.1"}
        self._names = 0

    def end(self, world: int, order: dict[str, Any], *, small_segments: bool = True) -> Process:
        """Start a process that sends, receives or serves in ROS 1 or ROS 2 (``world``), as ordered."""
        environment = dict(self.environment)
        argument = json.dumps(order)
        if world == 1:
            in_ros1 = str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1")
            return Process([in_ros1, "python3", str(ENDS / "ros1.py"), argument], environment)
        if small_segments:
            environment = {name: value for name, value in environment.items() if name not in PROFILES}
        return Process([sys.executable, "-m", "bridge_tools.bench_ends.ros2", argument], environment)

    @contextlib.contextmanager
    def bridge(self, configuration: dict[str, list[dict[str, Any]]]) -> Iterator[Process]:
        """Run a bridge; it bridges when the block begins."""
        file = self._folder / "bench.yaml"
        file.write_text(json.dumps(configuration), encoding="utf-8")  # JSON is YAML
        with Process([sys.executable, "-m", "ros_bridge", "--config", str(file)], self.environment, watch_errors=True) as process:
            while "bridging" not in process.line():
                pass
            yield process

    def fresh(self, number: int) -> list[str]:
        """Return names that no case had before: nothing of an earlier one may still be on its way."""
        self._names += 1
        return [f"/bench/t{self._names}_{index}" for index in range(number)]

    def run(self, case: Case) -> dict[str, float]:
        """Run a case; return its figures."""
        with contextlib.ExitStack() as stack:
            names = self.fresh(case.topics if isinstance(case, TopicCase) else 1)
            bridge = stack.enter_context(self.bridge(_configuration(case, names))) if case.way.bridged else None
            before = usage(bridge.pid) if bridge else Usage(0.0, 0.0)
            figures = self._topics(case, names, stack) if isinstance(case, TopicCase) else self._service(case, names, stack)
            if bridge:
                after = usage(bridge.pid)
                figures |= {"bridge_cpu_s": after.cpu_s - before.cpu_s, "bridge_peak_mb": after.peak_mb}
            return figures

    def _topics(self, case: TopicCase, names: list[str], stack: contextlib.ExitStack) -> dict[str, float]:
        from_world, to_world = case.way.worlds
        order = {"kind": case.kind, "topics": names, "size_bytes": case.size_bytes, "rate_hz": case.rate_hz}
        order |= {"number": case.number, "seconds": case.seconds, "queue": case.queue}
        receiver = stack.enter_context(self.end(to_world, order | {"do": "receive"}, small_segments=case.small_segments))
        receiver.expect("ready")
        sender = stack.enter_context(self.end(from_world, order | {"do": "send"}, small_segments=case.small_segments))
        receiver.expect("first")
        sender.tell("go")
        sent = sender.expect("sent")["number"]
        _wait_drained(receiver, sent)
        receiver.tell("finish")
        figures = receiver.expect("figures")
        sender.tell("finish")
        return {"sent": sent} | {key: value for key, value in figures.items() if key != "event"}

    def _service(self, case: ServiceCase, names: list[str], stack: contextlib.ExitStack) -> dict[str, float]:
        client_world, server_world = case.way.worlds
        order = {"topics": names, "number": case.calls, "persistent": case.persistent}
        server = stack.enter_context(self.end(server_world, order | {"do": "serve"}))
        server.expect("ready")
        client = stack.enter_context(self.end(client_world, order | {"do": "call"}))
        client.expect("ready")
        client.tell("go")
        figures = client.expect("figures")
        return {"sent": case.calls} | {key: value for key, value in figures.items() if key != "event"}

    def start_and_idle(self, idle_s: float) -> dict[str, float]:
        """Measure from the bridge's start to the first message that is received, and what the bridge takes while nothing crosses."""
        names = self.fresh(1)
        case = TopicCase("start", "string", 64, 1.0, 1.0, Way.UP)
        order = {"kind": "string", "topics": names, "size_bytes": 64, "rate_hz": 1.0, "number": 1, "seconds": 1.0, "queue": case.queue}
        with contextlib.ExitStack() as stack:
            receiver = stack.enter_context(self.end(2, order | {"do": "receive"}))
            receiver.expect("ready")
            sender = stack.enter_context(self.end(1, order | {"do": "send"}))
            time.sleep(DRAINED_S)  # the sender publishes by now
            bridge = stack.enter_context(self.bridge(_configuration(case, names)))
            first_ns = receiver.expect("first")["time_ns"]
            sender.tell("go")
            sender.expect("sent")
            before = usage(bridge.pid)
            time.sleep(idle_s)
            idle = (usage(bridge.pid).cpu_s - before.cpu_s) / idle_s
            return {"start_s": (first_ns - bridge.started_ns) / 1e9, "idle_percent": 100 * idle}


def _wait_drained(receiver: Process, sent: int) -> None:
    """Return when everything has arrived, or nothing more comes."""
    last, since_s = -1, time.monotonic()
    while time.monotonic() - since_s < DRAINED_S:
        receiver.tell("count")
        received = receiver.expect("count")["received"]
        if received >= sent:
            return
        if received != last:
            last, since_s = received, time.monotonic()
        time.sleep(0.05)


def _configuration(case: Case, names: list[str]) -> dict[str, list[dict[str, Any]]]:
    if isinstance(case, ServiceCase):
        server = f"ros{case.way.worlds[1]}"
        return {"services": [{"name": name, "server": server, "type": "std_srvs/SetBool"} for name in names]}
    direction = "ros1_to_ros2" if case.way is Way.UP else "ros2_to_ros1"
    return {"topics": [{"name": name, "direction": direction, "type": ROS1_TYPES[case.kind]} for name in names]}


@contextlib.contextmanager
def open_bench() -> Iterator[Bench]:
    """Run a master, and give the bench to measure with. Raises BenchError."""
    uri = f"http://127.0.0.1:{free_port()}"
    in_ros1 = str(Path(os.environ["ALULA_ROOT"]) / "setup" / "in_ros1")
    command = [in_ros1, "rosmaster", "--core", "-p", uri.rpartition(":")[2]]
    with tempfile.TemporaryDirectory() as folder, Process(command, {**os.environ, "ROS_MASTER_URI": uri, "ROS_IP": "127.0.0.1"}):
        limit = threading.Timer(WITHIN_S, (stop := threading.Event()).set)
        limit.daemon = True
        limit.start()
        if not wait_for_master(Connection(uri), "/bench", stop):
            raise BenchError(f"the ROS master at {uri} does not answer within {WITHIN_S:.0f} s")
        limit.cancel()
        yield Bench(uri, Path(folder))
