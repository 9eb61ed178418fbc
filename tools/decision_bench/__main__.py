"""Measure the decision side of the drone, as `alula up` runs it, beside a ROS master of its own: ``./alula bench decision``.

Bridge, managers of three skillsets, and a mission that waits for the robot; nothing is asked of them. The managers run in one process, in
one for each skillset, and in one for each skill, too. From ``/proc``: RSS counts memory that processes share once for each, PSS once.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import psutil

from alula.common.deployments import Deployment, Processes
from alula.common.network import claim_domain, free_port
from alula.common.robots import find_robot
from alula_flight.station.parts import Part, Places, parts_of, places_of

SKILLSETS = ("navigation", "perception", "mapping")
SECONDS, SETTLE_S, END_S = 30.0, 8.0, 20.0  # wall clock
MB = 1e6


class UnreadyError(Exception):
    """The decision side can't be measured: its skillsets can't be called."""


@dataclass(frozen=True)
class Usage:
    """What processes hold, 1e6 bytes, and take of one core; ``count``: how many they are."""

    count: int
    rss_mb: float
    pss_mb: float
    core: float


@dataclass(frozen=True)
class Figures:
    """What was measured of a deployment.

    Attributes:
        up_s: wall clock from the start of bridge and managers until clients can call all skills; ``up_cpu_s``: their processor time.
        parts: what each takes then, and the mission.
    """

    up_s: float
    up_cpu_s: float
    parts: Mapping[str, Usage]

    @property
    def whole(self) -> Usage:
        """Return what all parts take."""
        usages = list(self.parts.values())
        return Usage(*(sum(getattr(one, name) for one in usages) for name in ("count", "rss_mb", "pss_mb", "core")))


@contextmanager
def running(part: Part, places: Places) -> Iterator[subprocess.Popen[bytes]]:
    """Run a part, and end it."""
    with (places.logs / f"{part.name}.log").open("wb") as said:
        process = subprocess.Popen(part.words, env=dict(part.environment), stdout=said, stderr=said, start_new_session=True)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def tree_of(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """Return a process and all below it."""
    top = psutil.Process(process.pid)
    return [top, *top.children(recursive=True)]


def cpu_s(tree: Sequence[psutil.Process]) -> float:
    """Return the processor time that processes have taken, user and system."""
    return sum(sum(one.cpu_times()[:2]) for one in tree)


def measured(processes: Mapping[str, subprocess.Popen[bytes]], seconds: float) -> dict[str, Usage]:
    """Return what processes and their children take over a time of wall clock."""
    trees = {name: tree_of(one) for name, one in processes.items()}
    begun_s, before_s = time.monotonic(), {name: cpu_s(tree) for name, tree in trees.items()}
    time.sleep(seconds)
    after_s, lasted_s = {name: cpu_s(tree) for name, tree in trees.items()}, time.monotonic() - begun_s
    held = {name: [one.memory_full_info() for one in tree] for name, tree in trees.items()}
    return {
        name: Usage(
            len(tree),
            sum(one.rss for one in held[name]) / MB,
            sum(one.pss for one in held[name]) / MB,
            (after_s[name] - before_s[name]) / lasted_s,
        )
        for name, tree in trees.items()
    }


def measure(processes: Processes, seconds: float, folder: Path) -> Figures:
    """Run the decision side with its managers in so many processes, and measure it."""
    robot, claim, port = find_robot(), claim_domain(), free_port()
    deployment = Deployment(
        "bench",
        robot.root / "deployments/bench.yaml",
        master=f"http://127.0.0.1:{port}",
        domain=claim.domain,
        managers={name: (f"uav_skills.{name}:make_hooks",) for name in SKILLSETS},
        processes=processes,
        bridge="uav_bridge.yaml",
    )
    usual = places_of(deployment, robot)
    places = Places(usual.root, usual.robot, folder)
    places.logs.mkdir(parents=True)
    parts = parts_of(deployment, places, "", os.environ)
    environment = parts[0].environment
    core = Part("roscore", places.in_ros1("roscore", "-p", str(port)), environment)
    mission = ("python", "-m", "skillset_ros2.mission", "--scenario", "mapping", "--out", str(folder / "mission"))
    waits = ("--ros-args", "-p", "heartbeat:=false", "-p", "start_timeout_s:=1000.0")
    with ExitStack() as stack:
        stack.callback(claim.release)
        stack.enter_context(running(core, places))
        client = stack.enter_context(
            subprocess.Popen(
                places.in_ros2("client", "python", "-m", "decision_bench.client", *SKILLSETS), env=environment, stdout=subprocess.PIPE
            )
        )
        assert client.stdout is not None  # noqa: S101 - it is a pipe
        client.stdout.readline()
        begun_s = time.monotonic()
        found = {part.name: stack.enter_context(running(part, places)) for part in parts}
        if client.stdout.readline() != b"ready\n":
            raise UnreadyError(f"the skillsets can't be called; the words of the parts are in {places.logs}")
        up_s, up_cpu_s = time.monotonic() - begun_s, sum(cpu_s(tree_of(one)) for one in found.values())
        found["mission"] = stack.enter_context(running(Part("mission", places.in_ros2("mission", *mission, *waits), environment), places))
        time.sleep(SETTLE_S)  # what is imported and discovered at the start is not idle
        return Figures(up_s, up_cpu_s, measured(found, seconds))


def table(figures: Mapping[str, Figures]) -> str:
    """Return the figures as Markdown."""
    lines = ["| managers | part | processes | RSS MB | PSS MB | of a core |", "|---|---|---|---|---|---|"]
    for name, one in figures.items():
        for part, usage in [*one.parts.items(), (f"all; up in {one.up_s:.1f} s, {one.up_cpu_s:.1f} s of processor time", one.whole)]:
            lines.append(f"| {name} | {part} | {usage.count} | {usage.rss_mb:.0f} | {usage.pss_mb:.0f} | {usage.core:.3f} |")
    return "".join(f"{line}\n" for line in lines)


def main(words: Sequence[str] | None = None) -> int:
    """Measure; return the exit code."""
    parser = argparse.ArgumentParser(prog="alula bench decision", description="Measure the decision side while nothing is asked of it.")
    parser.add_argument("--seconds", type=float, default=SECONDS, help=f"how long each is measured (default {SECONDS:g})")
    parser.add_argument("--processes", choices=[one.value for one in Processes], action="append", help="only this; may be repeated")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures to this file")
    given = parser.parse_args(words)
    if not given.seconds > 0.0:
        parser.error(f"--seconds {given.seconds:g}: is a time, above 0")
    figures: dict[str, Figures] = {}
    with ExitStack() as cleaned:
        folder = Path(tempfile.mkdtemp(prefix="alula_bench_"))
        cleaned.callback(shutil.rmtree, folder)
        try:
            for name in given.processes or [one.value for one in Processes]:
                figures[name] = measure(Processes(name), given.seconds, folder / name)
        except UnreadyError as error:
            cleaned.pop_all()  # the folder says why
            sys.stderr.write(f"{parser.prog}: {error}\n")
            return 1
    if given.json is not None:
        given.json.write_text(json.dumps({name: asdict(one) for name, one in figures.items()}, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(table(figures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
