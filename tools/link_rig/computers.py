"""A robot on two computers: its base by plain roslaunch on one, `alula up` and `alula run --on` on the other, and a link that is cut."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from typing import Any

import psutil
import yaml

from alula.common.network import claim_domain
from alula.common.processes import command_line, node_name, processes_of_run
from alula_testing.networks import Computer, Network
from alula_testing.ros1 import end_process
from alula_testing.waits import until
from alula_testing.wall_clock import WallClock
from link_rig.robots import ALULA_ROOT, Robot
from link_rig.verdicts import End, Pose

IN_ROS1 = str(ALULA_ROOT / "setup/in_ros1")
MASTER_PORT = 11311
LOOK_S = 0.1
OFFSET = re.compile(r"master's computer is ([0-9.]+) s (ahead of|behind) ours")
FOREIGN = ("ROS_", "ALULA_", "PYTHON", "AMENT", "CMAKE")
"""Variables of the caller that begin so are not the computers'."""


class RigError(Exception):
    """A computer does not do what the rig needs of it; the message says which, and where its words are."""


class TwoComputers:
    """A robot's base on one computer and its decision side on the other."""

    def __init__(self, network: Network, robot: Robot, folder: Path) -> None:
        """Take two computers of a network; ``folder`` takes what they write."""
        self.network, self.robot, self.folder = network, robot, folder
        self.base, self.decision = network.computer("base"), network.computer("decision")
        self._inside = {one.name: _namespace(_holder(one)) for one in (self.base, self.decision)}  # also told once the holder has died
        self._claim = claim_domain()  # of this machine, as shared memory is
        self._name = f"link_rig_{os.getpid()}"
        self._deployment = robot.folder / f"deployments/{self._name}.yaml"
        self._processes: list[subprocess.Popen[bytes]] = []
        self._boots = self._missions = 0
        self._clock: WallClock | None = None
        self._world = folder / "world.yaml"
        world = yaml.safe_load(robot.world.read_text(encoding="utf-8"))
        self._world.write_text(yaml.safe_dump({**world, **robot.shorter}), encoding="utf-8")

    # --- the base's computer -----------------------------------------------------------------------------------------

    def start_base(self) -> None:
        """Start master, simulator and functional layer, and the watch of the truth, which is of this boot alone."""
        self._boots += 1
        out = self.folder / f"base{self._boots}"
        out.mkdir()
        self.start_master()
        words = [IN_ROS1, "roslaunch", str(self.robot.launch), f"world:={self.robot.world}", f"out:={out}"]
        words += [f"{name}:={value}" for name, value in self.robot.arguments.items()]
        base = self._start(out.name, self.base, words, self._base_environment)
        watch = str(Path(__file__).with_name("truth_watch.py"))
        words = [IN_ROS1, "python3", watch, str(self._truth), "drone" if self.robot.still.flies else "rover", self.robot.moves_by]
        self._start(f"truth{self._boots}", self.base, words, self._base_environment)
        until(lambda: self.poses() or base.poll() is not None, f"the simulator tells where it is ({self.folder})", every_s=LOOK_S)
        if base.poll() is not None:
            raise RigError(f"the base ended with {base.returncode}: {self.folder / out.name}.log")

    def start_master(self) -> None:
        """Start the ROS master of the base, which knows of no node."""
        words = [IN_ROS1, "rosmaster", "--core", "-p", str(MASTER_PORT)]
        self._master = self._start("master", self.base, words, self._base_environment)
        probe = self.base.command("bash", "-c", f"exec 3<>/dev/tcp/{self.base.address}/{MASTER_PORT}")
        until(lambda: subprocess.run(probe, capture_output=True, check=False).returncode == 0, "the master answers", every_s=LOOK_S)

    def kill_master(self) -> None:
        """Kill the ROS master."""
        self._master.kill()
        self._master.wait()

    @property
    def _base_environment(self) -> dict[str, str]:
        ros1 = self.base.ros1_environment(self.base, port=MASTER_PORT)
        graph = {name: ros1[name] for name in ("ROS_MASTER_URI", "ROS_IP")}
        return {**self._environment(), "ALULA_ROBOT": str(self.robot.folder), "ROS_HOME": str(self.folder / "ros"), **graph}

    @property
    def silent_after_s(self) -> float:
        """Return the limit of the base's dead man, simulated seconds."""
        return float(yaml.safe_load(self.robot.dead_man.read_text(encoding="utf-8"))["silent_after_s"])

    @property
    def collisions(self) -> int:
        """Return how often it has run into something since its base was started."""
        return max((int(one["collisions"]) for one in self._told() if "collisions" in one), default=0)

    def poses(self) -> list[Pose]:
        """Return where it truly was since its base was started."""
        return [Pose(**one) for one in self._told() if "x" in one]

    def beats(self) -> list[float]:
        """Return when a heartbeat of the managers that move it came to the base, simulated time."""
        beats, now_s = [], 0.0
        for one in self._told():
            now_s = float(one.get("stamp_s", now_s))
            if "beat" in one:
                beats.append(now_s)
        return beats

    @property
    def _truth(self) -> Path:
        return self.folder / f"truth{self._boots}.jsonl"

    def _told(self) -> list[dict[str, Any]]:
        if not self._truth.exists():
            return []
        whole = self._truth.read_text(encoding="utf-8").rpartition("\n")[0]
        return [json.loads(line) for line in whole.splitlines()]

    # --- the decision side's -----------------------------------------------------------------------------------------

    def up(self) -> None:
        """Start bridge and managers; raises RigError."""
        self._deployment.parent.mkdir(exist_ok=True)
        lines = [
            "about: of a test, which removes it",
            f"ros1: {{master: 'http://{self.base.address}:{MASTER_PORT}', address: {self.decision.address}}}",
            f"ros2: {{domain: {self._claim.domain}}}",
            "managers:",
            *(f"  {name}: {maker}" for name, maker in self.robot.hooks.items()),
            f"bridge: {self.robot.bridge}",
        ]
        self._deployment.write_text("\n".join(lines) + "\n", encoding="utf-8")
        done = self._alula("up", self._name)
        if done.returncode:
            raise RigError(f"alula up ended with {done.returncode}: {done.stderr}")

    def start_mission(self) -> Mission:
        """Start a short mission on what is up."""
        self._missions += 1
        out = self.folder / f"run{self._missions}"
        told = ("run", self.robot.scenario, "--on", self._name, "--world", str(self._world), "--out", str(out))
        return Mission(out, self._start(out.name, self.decision, self._words(*told), self._decision_environment))

    def pid_of(self, part: str) -> int:
        """Return the process of a part that is up."""
        return self.kept()[part]

    def kept(self) -> dict[str, int]:
        """Return the processes of the parts that are up, and of their keeper."""
        said = json.loads((self._up / "state.json").read_text(encoding="utf-8"))
        parts = {name: int(one["pid"]) for name, one in said["parts"].items()}
        return {name: pid for name, pid in {**parts, "keeper": int(said["keeper"])}.items() if pid and psutil.pid_exists(pid)}

    @property
    def _up(self) -> Path:
        state = self.robot.folder / ".alula"
        return (state / "robot" if self.robot.folder == ALULA_ROOT else state) / "up" / self._name

    def nodes(self) -> dict[str, int]:
        """Return the nodes of the base that roslaunch has started."""
        inside, found = self._inside[self.base.name], {}
        for process in psutil.process_iter():
            with suppress(OSError, psutil.Error):
                if _namespace(process.pid) == inside and (name := node_name(process)):
                    found[name] = process.pid
        return found

    def _alula(self, *words: str) -> subprocess.CompletedProcess[str]:
        words = tuple(self.decision.command(*self._words(*words)))
        return subprocess.run(words, env=self._decision_environment, capture_output=True, text=True, check=False)

    def make_clock(self) -> None:
        """Have what runs on the decision computer from now on know a wall clock that can be set."""
        self._clock = WallClock(self.folder)

    def step_clock(self, by_s: int) -> None:
        """Set that clock forward, or back."""
        if self._clock is None:
            raise RigError("the decision computer has this machine's clock")
        self._clock.step(by_s)

    def clock_by_doctor(self) -> float | None:
        """Return by how far the base's clock is ahead of the decision computer's, as `alula doctor` says; None: it does not."""
        for line in self._alula("doctor", self._name, "--json").stdout.splitlines():
            if found := OFFSET.search(line):
                return float(found[1]) * (1.0 if found[2] == "ahead of" else -1.0)
        return None

    def clock_by_status(self) -> float | None:
        """Return the same as `alula status` says, which looks each minute; None: it does not know of a step within two."""

        def said() -> float | None:
            ahead_s = json.loads(self._alula("status", self._name, "--json").stdout)["clock_ahead_s"]
            return None if ahead_s is None else float(ahead_s)

        with suppress(AssertionError):
            until(lambda: abs(said() or 0.0) > 1.0, "a step is told", 120.0, 2.0)
        return said()

    @property
    def _decision_environment(self) -> dict[str, str]:
        return {**self._environment(), **(self._clock.variables if self._clock else {})}

    def _words(self, *words: str) -> list[str]:
        # Not by `cwd`: who enters a mount namespace stands in its root.
        return ["env", "-C", str(self.robot.folder), str(ALULA_ROOT / "alula"), *words]

    def _environment(self) -> dict[str, str]:
        return {name: value for name, value in os.environ.items() if not name.startswith(FOREIGN)}

    # --- both --------------------------------------------------------------------------------------------------------

    def kill_all(self, computer: Computer) -> None:
        """Kill all that runs on a computer, as when its power goes."""
        holder, inside = _holder(computer), self._inside[computer.name]
        for process in psutil.process_iter():
            with suppress(OSError, psutil.Error):
                if process.pid != holder and _namespace(process.pid) == inside:
                    process.kill()

    def close(self) -> None:
        """End all that runs on both computers."""
        try:
            if self._deployment.exists():
                self._alula("down", self._name)
            for process in reversed(self._processes):
                end_process(process, timeout_s=20.0)
        finally:
            self.kill_all(self.decision)
            self.kill_all(self.base)
            self._claim.release()
            self._deployment.unlink(missing_ok=True)
            with suppress(OSError):  # another rig's may be there
                self._deployment.parent.rmdir()
            rmtree(self._up, ignore_errors=True)

    def _start(self, name: str, computer: Computer, words: Sequence[str], environment: dict[str, str]) -> subprocess.Popen[bytes]:
        with (self.folder / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                computer.command(*words), env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
            )
        self._processes.append(process)
        return process


class Mission:
    """A mission under way: its folder, and the process of `alula run`."""

    def __init__(self, folder: Path, run: subprocess.Popen[bytes]) -> None:
        self._folder, self._run = folder, run

    @property
    def ended(self) -> bool:
        """Return whether `alula run` has ended, and all that it has started."""
        return self._run.poll() is not None and not self._processes

    @property
    def pid(self) -> int:
        """Return the process of the mission itself, which decides."""
        return self.processes["mission"]

    @property
    def processes(self) -> dict[str, int]:
        """Return the processes of `alula run`: ``front``, ``supervisor`` and ``mission``, where they are there."""
        found = {"front": self._run.pid} if self._run.poll() is None else {}
        for one in self._processes:
            if node_name(one) == "mission":
                found["mission"] = one.pid
            elif "alula_flight.attached" in command_line(one):
                found["supervisor"] = one.pid
        return found

    @property
    def _processes(self) -> list[psutil.Process]:
        try:
            run_id = json.loads((self._folder / "run.json").read_text(encoding="utf-8"))["run_id"]
        except (OSError, ValueError):  # it has not come so far
            return []
        return processes_of_run(run_id)

    @property
    def end(self) -> End:
        """Return how it ended: what its summary says, or that there is none."""
        summary = self._folder / "summary.json"
        if not summary.exists():
            return End("gone", f"no summary, exit code {self._run.poll()}")
        said = json.loads(summary.read_text(encoding="utf-8"))
        died = [f"{one['name']} died ({one['how']})" for one in said["died"]]
        return End(str(said["outcome"]), "; ".join([*([said["reason"]] if said["reason"] else []), *died]))


def _holder(computer: Computer) -> int:
    """Return the process that keeps a computer's network there."""
    return int(computer.enter[1].partition("=")[2])


def _namespace(pid: int) -> Path:
    return Path(f"/proc/{pid}/ns/net").readlink()


@contextmanager
def two_computers(robot: Robot, folder: Path, *, sets_clock: bool = False) -> Iterator[TwoComputers]:
    """Have the base run and the decision side be up; with ``sets_clock`` the wall clock of the latter can be set."""
    with Network() as network:
        rig = TwoComputers(network, robot, folder)
        try:
            if sets_clock:
                rig.make_clock()
            rig.start_base()
            rig.up()
            yield rig
        finally:
            rig.close()
