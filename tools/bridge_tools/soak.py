"""Run the bridge for minutes amid coming and going: ``setup/in_ros2 python -m bridge_tools.soak --minutes 30``.

It starts a ROS master and a bridge of its own. Two steady topics, one each way, carry numbered messages at 100 Hz, and a ROS 1 client calls
a ROS 2 service, while publishers and subscribers of other topics come and go in both worlds and the master is killed and started
again. Prints figures as JSON; ends with 1 when a steady message was lost, a call failed, or the bridge's memory grew.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import os
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import psutil

from alula.common.network import free_port
from alula.common.processes import die_with_parent
from bridge_tools import two_worlds
from bridge_tools.fuzz import memory_mb

PERIOD_S = 0.01
START_WITHIN_S = 30.0
STRAGGLERS_S = 5.0
BACK_WITHIN_S = 4.0  # a new master has started within 2 s, and the bridge has registered with it within 2 s more
RESTART_EVERY_S = 20.0
WARM_UP_S = 60.0
GROWTH_LIMIT_MB = 10.0
CHURN_TOPICS = 6
MASTER_GONE = ("unable to contact master", "unavailable")  # rospy's words for a look-up that failed
UP, DOWN, SERVICE = "/soak/up", "/soak/down", "/soak/service"
RUN_MASTER = (
    "import sys; sys.path.insert(0, sys.argv[1]); import rosmaster; rosmaster.rosmaster_main(['rosmaster', '--core', '-p', sys.argv[2]])"
)


@dataclass
class Steady:
    """A steady route's numbers: what was sent and which of it has not come."""

    sent: int = 0
    received: int = 0
    lost: int = 0
    disorder: int = 0
    last: int = -1

    def take(self, number: int) -> None:
        """Count an arrival; a gap in the numbers is a loss."""
        self.received += 1
        self.disorder += number <= self.last
        self.last = max(self.last, number)


@dataclass
class SoakFigures:
    """What a run has shown."""

    seconds: float = 0.0
    up: Steady = field(default_factory=Steady)
    down: Steady = field(default_factory=Steady)
    calls: int = 0
    failures: list[str] = field(default_factory=list)
    comings_and_goings: int = 0
    master_restarts: int = 0
    memory_mb: float = 0.0
    grown_mb: float = 0.0
    files_grown: int = 0

    @property
    def good(self) -> bool:
        """Return whether nothing was lost and nothing grew."""
        lost = self.up.lost + self.down.lost + self.up.disorder + self.down.disorder + len(self.failures)
        return lost == 0 and self.up.sent > 0 and self.calls > 0 and self.grown_mb < GROWTH_LIMIT_MB


class Master:
    """A ROS master in a process of its own, on one port however often it is started."""

    def __init__(self, folder: Path) -> None:
        self._command = [sys.executable, "-c", RUN_MASTER, str(two_worlds.find_ros1_path()), str(free_port())]
        self._log = (folder / "master.log").open("wb")
        self.uri = f"http://127.0.0.1:{self._command[-1]}"
        self._process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(self._command, stdout=self._log, stderr=self._log, preexec_fn=die_with_parent)  # noqa: PLW1509
        end_s = time.monotonic() + START_WITHIN_S
        while time.monotonic() < end_s:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", int(self._command[-1])), timeout=1.0):
                return process
            time.sleep(0.05)
        raise TimeoutError("the ROS master does not start")

    def restart(self) -> None:
        """Kill it and start a new one, which knows nothing."""
        self.close()
        self._process = self._start()

    def close(self) -> None:
        """Kill the master's process."""
        self._process.kill()
        self._process.wait()


def configuration() -> str:
    """Return the bridge's configuration file for the soak: fixed topics, those that come and go, a service."""
    lines = ["topics:"]
    lines += [f"  - {{name: {UP}, direction: ros1_to_ros2, type: std_msgs/String, depth: 1000}}"]
    lines += [f"  - {{name: {DOWN}, direction: ros2_to_ros1, type: std_msgs/String, depth: 1000}}"]
    for number in range(CHURN_TOPICS):
        lines += [
            f"  - {{name: /soak/up{number}, direction: ros1_to_ros2, type: std_msgs/String, latched: {str(number % 2 == 0).lower()}}}"
        ]
        lines += [f"  - {{name: /soak/down{number}, direction: ros2_to_ros1, type: std_msgs/String}}"]
    lines += ["services:", f"  - {{name: {SERVICE}, server: ros2, type: std_srvs/SetBool, timeout_s: 10.0}}"]
    return "\n".join(lines) + "\n"


@contextlib.contextmanager
def bridge_process(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run a bridge; what it says is in ``bridge.log`` in the folder."""
    (folder / "soak.yaml").write_text(configuration(), encoding="utf-8")
    with (folder / "bridge.log").open("wb") as log:
        command = [sys.executable, "-m", "ros_bridge", "--config", str(folder / "soak.yaml")]
        process = subprocess.Popen(command, stderr=log, preexec_fn=die_with_parent)  # noqa: PLW1509
        try:
            end_s = time.monotonic() + START_WITHIN_S
            while "bridging" not in (folder / "bridge.log").read_text(encoding="utf-8"):
                if time.monotonic() > end_s or process.poll() is not None:
                    raise TimeoutError(f"the bridge does not start: {(folder / 'bridge.log').read_text(encoding='utf-8')}")
                time.sleep(0.1)
            yield process
        finally:
            process.terminate()
            process.wait()


class Ends:
    """The peers in both worlds, in this process; steady ones from the beginning, others as told."""

    def __init__(self, figures: SoakFigures, dice: random.Random, ros1: Mapping[str, Any]) -> None:
        """Open the steady ends. Both worlds have to be initialised; ``ros1`` has ROS 1's modules of std_msgs and std_srvs."""
        import rclpy
        import rospy
        from rclpy.executors import SingleThreadedExecutor
        from std_msgs.msg import String
        from std_srvs.srv import SetBool

        from ros_bridge.spinning import spin

        self._figures, self._dice, self._rospy, self._string = figures, dice, rospy, String
        self._class = ros1["std_msgs.msg"].String
        self._service_class = ros1["std_srvs.srv"].SetBool
        self._node = rclpy.create_node("ros_bridge_soak")
        self._node.create_subscription(String, UP, lambda message: figures.up.take(int(message.data)) if message.data else None, 1000)
        self._node.create_service(SetBool, SERVICE, lambda request, _: SetBool.Response(success=request.data))
        self._down = self._node.create_publisher(String, DOWN, 1000)
        rospy.Subscriber(DOWN, self._class, lambda message: self._take_down(message.data))
        self._up = rospy.Publisher(UP, self._class, queue_size=1000)
        self._changing: list[Callable[[], None]] = []
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        threading.Thread(target=spin, args=(executor,), daemon=True).start()

    def _take_down(self, text: str) -> None:
        if text:
            self._figures.down.take(int(text))

    def publish(self, number: int | None) -> None:
        """Send a number both ways; without one an empty text, to see whether the way is open."""
        text = "" if number is None else str(number)
        self._up.publish(self._class(text))
        self._down.publish(self._string(data=text))

    def connected(self) -> bool:
        """Return whether the bridge is at both steady topics."""
        return bool(self._up.get_num_connections() and self._down.get_subscription_count())

    def call(self) -> None:
        """Call the service of ROS 2 as a ROS 1 client, over a connection of its own."""
        self._figures.calls += 1
        end_s = time.monotonic() + BACK_WITHIN_S
        while True:
            try:
                self._rospy.wait_for_service(SERVICE, max(0.1, end_s - time.monotonic()))
                answer = self._rospy.ServiceProxy(SERVICE, self._service_class)(data=True)
            except (self._rospy.ServiceException, self._rospy.ROSException, OSError) as error:
                # The master may go between these two lines; then no server was called.
                if any(word in str(error) for word in MASTER_GONE) and time.monotonic() < end_s:
                    continue
                self._figures.failures.append(str(error))
            else:
                if not answer.success:
                    self._figures.failures.append(f"answered {answer}")
            return

    def come_or_go(self) -> None:
        """Open an end of a changing topic, or close one."""
        self._figures.comings_and_goings += 1
        if len(self._changing) > CHURN_TOPICS or (self._changing and self._dice.random() < 0.4):
            self._changing.pop(self._dice.randrange(len(self._changing)))()
            return
        number = self._dice.randrange(CHURN_TOPICS)
        self._changing.append(
            self._dice.choice((self._ros1_publisher, self._ros1_subscriber, self._ros2_publisher, self._ros2_subscriber))(number)
        )

    def _ros1_publisher(self, number: int) -> Callable[[], None]:
        end: Any = self._rospy.Publisher(f"/soak/up{number}", self._class, queue_size=10, latch=True)
        end.publish(self._class("a"))
        return end.unregister  # type: ignore[no-any-return]

    def _ros1_subscriber(self, number: int) -> Callable[[], None]:
        end: Any = self._rospy.Subscriber(f"/soak/down{number}", self._class, lambda _: None)
        return end.unregister  # type: ignore[no-any-return]

    def _ros2_publisher(self, number: int) -> Callable[[], None]:
        end: Any = self._node.create_publisher(self._string, f"/soak/down{number}", 10)
        end.publish(self._string(data="a"))
        return lambda: self._node.destroy_publisher(end)

    def _ros2_subscriber(self, number: int) -> Callable[[], None]:
        end: Any = self._node.create_subscription(self._string, f"/soak/up{number}", lambda _: None, 10)
        return lambda: self._node.destroy_subscription(end)


def open_files(pid: int) -> int:
    """Return how many files and sockets a process has open."""
    return int(psutil.Process(pid).num_fds())


class Soak:
    """One soak: peers of both worlds come and go, and the master restarts, while messages are counted."""

    def __init__(self, seconds: float, seed: int, master: Master, pid: int, ros1: Mapping[str, Any]) -> None:
        """Prepare; the bridge runs, with this process id. ``ros1`` as of ``Ends``."""
        self._seconds, self._master, self._pid = seconds, master, pid
        self.figures = SoakFigures()
        self._dice = random.Random(seed)  # noqa: S311 - repeatable, not secret
        self._ends = Ends(self.figures, self._dice, ros1)
        self._stop = threading.Event()
        # A process dies with the thread that has started it (Linux, PR_SET_PDEATHSIG): the master would go while a call still needs it.
        self._all_done = threading.Barrier(3)

    def _repeat(self, period_s: float, action: Callable[[], None]) -> threading.Thread:
        def run() -> None:
            while not self._stop.wait(period_s * self._dice.uniform(0.5, 1.5)):
                action()
            self._all_done.wait()

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        return thread

    def _restart_master(self) -> None:
        self._master.restart()
        self.figures.master_restarts += 1

    def _open_ways(self) -> None:
        end_s = time.monotonic() + START_WITHIN_S
        while not self._ends.connected():
            if time.monotonic() > end_s:
                raise TimeoutError("the steady routes do not open")
            time.sleep(0.05)
        for _ in range(50):  # what is on the way while connections are made may get lost in either world
            self._ends.publish(None)
            time.sleep(0.02)

    def run(self) -> SoakFigures:
        """Run, and return the figures."""
        self._open_ways()
        figures, start_s = self.figures, time.monotonic()
        restart_s = min(RESTART_EVERY_S, self._seconds / 3)
        threads = [
            self._repeat(0.3, self._ends.come_or_go),
            self._repeat(0.5, self._ends.call),
            self._repeat(restart_s, self._restart_master),
        ]
        warm_s = min(WARM_UP_S, self._seconds / 2)
        before: tuple[float, int] | None = None
        number = 0
        while (elapsed_s := time.monotonic() - start_s) < self._seconds:
            self._ends.publish(number)
            number += 1
            if before is None and elapsed_s > warm_s:
                before = memory_mb(self._pid), open_files(self._pid)
            time.sleep(max(0.0, start_s + number * PERIOD_S - time.monotonic()))
        self._stop.set()
        for thread in threads:
            thread.join(START_WITHIN_S)
        end_s = time.monotonic() + STRAGGLERS_S
        while min(figures.up.received, figures.down.received) < number and time.monotonic() < end_s:
            time.sleep(0.05)
        for steady in (figures.up, figures.down):
            steady.sent, steady.lost = number, number - steady.received
        figures.seconds = round(elapsed_s, 1)
        figures.memory_mb = round(memory_mb(self._pid), 1)
        if before is not None:
            figures.grown_mb, figures.files_grown = round(figures.memory_mb - before[0], 1), open_files(self._pid) - before[1]
        return figures


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print the figures; return 0 if they are good."""
    parser = argparse.ArgumentParser(prog="bridge_tools.soak", description="Runs a bridge for minutes while nodes come and go.")
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.ERROR)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        master = Master(folder)
        os.environ |= {"ROS_MASTER_URI": master.uri, "ROS_IP": "127.0.0.1", "ROS_LOG_DIR": name}
        ros1 = two_worlds.import_ros1("std_msgs.msg", "std_srvs.srv")
        import rclpy
        import rospy

        rospy.init_node("ros_bridge_soak", disable_signals=True, disable_rostime=True)
        rclpy.init(args=[])
        try:
            with bridge_process(folder) as bridge:
                figures = Soak(options.minutes * 60, options.seed, master, bridge.pid, ros1).run()
        finally:
            master.close()
    sys.stdout.write(json.dumps(asdict(figures) | {"good": figures.good}) + "\n")
    sys.stdout.flush()
    return 0 if figures.good else 1


if __name__ == "__main__":
    os._exit(main())  # rospy leaves threads that Python would wait for
