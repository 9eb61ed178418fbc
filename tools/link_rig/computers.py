"""The rover on two computers: its base by plain roslaunch on one, `alula up` and `alula run --on` on the other, and a link that is cut."""

from __future__ import annotations

import json
import os
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
from link_rig.verdicts import End, Pose

ALULA_ROOT = Path(__file__).resolve().parents[2]
ROVER = ALULA_ROOT / "examples/rover"
LAUNCH = ROVER / "ros1_ws/src/rover_navigation/launch/functional.launch"
WORLD = ROVER / "worlds/office.yaml"
DEAD_MAN = ROVER / "ros1_ws/src/rover_navigation/config/dead_man.yaml"
SKILLSETS = ("base", "perception", "power", "cargo")
IN_ROS1 = str(ALULA_ROOT / "setup/in_ros1")
MASTER_PORT = 11311
LOOK_S = 0.1
FOREIGN = ("ROS_", "ALULA_", "PYTHON", "AMENT", "CMAKE")
"""Variables of the caller that begin so are not the computers'."""


class RigError(Exception):
    """A computer does not do what the rig needs of it; the message says which, and where its words are."""


class TwoComputers:
    """The rover's base on one computer and its decision side on the other."""

    def __init__(self, network: Network, folder: Path) -> None:
        """Take two computers of a network; ``folder`` takes what they write."""
        self.network, self.folder = network, folder
        self.base, self.decision = network.computer("base"), network.computer("decision")
        self._inside = {one.name: _namespace(_holder(one)) for one in (self.base, self.decision)}  # also told once the holder has died
        self._claim = claim_domain()  # of this machine, as shared memory is
        self._name = f"link_rig_{os.getpid()}"
        self._deployment = ROVER / f"deployments/{self._name}.yaml"
        self._processes: list[subprocess.Popen[bytes]] = []
        self._truth = folder / "truth.jsonl"
        self._missions = 0
        self._world = folder / "world.yaml"
        world = yaml.safe_load(WORLD.read_text(encoding="utf-8"))
        self._world.write_text(yaml.safe_dump({**world, "rounds": ["corridor_east"]}), encoding="utf-8")

    # --- the base's computer -----------------------------------------------------------------------------------------

    def start_base(self) -> None:
        """Start master, simulator and functional layer, and the watch of the truth."""
        self.start_master()
        base = self._start("base", self.base, [IN_ROS1, "roslaunch", str(LAUNCH), f"world:={WORLD}"], self._base_environment)
        watch = Path(__file__).with_name("truth_watch.py")
        self._start("truth", self.base, [IN_ROS1, "python3", str(watch), str(self._truth)], self._base_environment)
        until(lambda: self.poses() or base.poll() is not None, f"the rover's simulator tells where it is ({self.folder})", every_s=LOOK_S)
        if base.poll() is not None:
            raise RigError(f"the base ended with {base.returncode}: {self.folder / 'base.log'}")

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
        return {**self._environment(), "ALULA_ROBOT": str(ROVER), "ROS_HOME": str(self.folder / "ros"), **graph}

    @property
    def silent_after_s(self) -> float:
        """Return the limit of the base's dead man, simulated seconds."""
        return float(yaml.safe_load(DEAD_MAN.read_text(encoding="utf-8"))["silent_after_s"])

    @property
    def collisions(self) -> int:
        """Return how often the rover has run into something."""
        return max((int(one["collisions"]) for one in self._told() if "collisions" in one), default=0)

    def poses(self) -> list[Pose]:
        """Return where the rover truly was until now."""
        return [Pose(**one) for one in self._told() if "x" in one]

    def beats(self) -> list[float]:
        """Return when a heartbeat of the managers that move it came to the base, simulated time."""
        beats, now_s = [], 0.0
        for one in self._told():
            now_s = float(one.get("stamp_s", now_s))
            if "beat" in one:
                beats.append(now_s)
        return beats

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
            *(f"  {name}: rover_robot.hooks.{name}:make_hooks" for name in SKILLSETS),
            "bridge: rover_bridge.yaml",
        ]
        self._deployment.write_text("\n".join(lines) + "\n", encoding="utf-8")
        done = self._alula("up", self._name)
        if done.returncode:
            raise RigError(f"alula up ended with {done.returncode}: {done.stderr}")

    def start_mission(self) -> Mission:
        """Start a patrol to the corridor's end and back on what is up."""
        self._missions += 1
        out = self.folder / f"run{self._missions}"
        told = ("run", "patrol", "--on", self._name, "--world", str(self._world), "--out", str(out))
        return Mission(out, self._start(out.name, self.decision, self._words(*told), self._environment()))

    def pid_of(self, part: str) -> int:
        """Return the process of a part that is up."""
        return self.kept()[part]

    def kept(self) -> dict[str, int]:
        """Return the processes of the parts that are up, and of their keeper."""
        said = json.loads((ROVER / ".alula/up" / self._name / "state.json").read_text(encoding="utf-8"))
        parts = {name: int(one["pid"]) for name, one in said["parts"].items()}
        return {name: pid for name, pid in {**parts, "keeper": int(said["keeper"])}.items() if pid and psutil.pid_exists(pid)}

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
        return subprocess.run(words, env=self._environment(), capture_output=True, text=True, check=False)

    def _words(self, *words: str) -> list[str]:
        # Not by `cwd`: who enters a mount namespace stands in its root.
        return ["env", "-C", str(ROVER), str(ALULA_ROOT / "alula"), *words]

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
            rmtree(ROVER / ".alula/up" / self._name, ignore_errors=True)

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
        """Tell whether `alula run` has ended, and all that it has started."""
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
def two_computers(folder: Path) -> Iterator[TwoComputers]:
    """Have the base run and the decision side be up."""
    with Network() as network:
        rig = TwoComputers(network, folder)
        try:
            rig.start_base()
            rig.up()
            yield rig
        finally:
            rig.close()
