"""Whole flights for tests: started as a user starts them, watched through the files of their folder."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from alula.common.processes import command_line, end_run, node_name, processes_of_run
from alula.common.record import DECISIONS, EVENTS, FILE, RecordFollower, read_record

ALULA_ROOT = Path(__file__).resolve().parents[3]
FLIGHT_LIMIT_S = 900.0  # wall clock; several times what a flight takes, so that a hang fails and a slow machine does not


@dataclass
class Flight:
    """One ``./alula fly`` and the folder it writes to."""

    process: subprocess.Popen[str]
    out: Path

    @property
    def run_id(self) -> str:
        """The id that all processes of the run carry."""
        return str(json.loads((self.out / "run.json").read_text(encoding="utf-8"))["run_id"])

    @property
    def domain(self) -> int:
        """Its DDS domain."""
        return int(json.loads((self.out / "run.json").read_text(encoding="utf-8"))["domain"])

    @property
    def summary(self) -> dict[str, Any]:
        """The run's summary."""
        return dict(json.loads((self.out / "summary.json").read_text(encoding="utf-8")))

    def events(self) -> list[dict[str, Any]]:
        """All events of the record so far."""
        return [dict(entry.value) for entry in RecordFollower(self.out / FILE).poll() if entry.topic == EVENTS]

    def processes(self) -> dict[str, int]:
        """Map each living node of the run (by the name that roslaunch gave it) and the supervisor to its process id."""
        found: dict[str, int] = {}
        for process in processes_of_run(self.run_id):
            name = "supervisor" if "alula_flight.supervisor" in command_line(process) else node_name(process)
            if name:
                found.setdefault(name, process.pid)
        return found

    def wait_for(self, what: str, condition: Callable[[], bool], *, limit_s: float = FLIGHT_LIMIT_S) -> None:
        """Wait until the condition holds; fail with the flight's output when it does not, or when the flight ends first."""
        end = time.monotonic() + limit_s
        while not condition():
            if self.process.poll() is not None or time.monotonic() > end:
                pytest.fail(f"{what}: not seen; the flight's exit code is {self.process.poll()}, its last words:\n{self.words()[-2000:]}")
            time.sleep(0.1)

    def wait_running(self, skill: str) -> None:
        """Wait until a skill runs."""
        self.wait_for(f"{skill} RUNNING", lambda: any(e.get("skill") == skill and e.get("state") == "RUNNING" for e in self.events()))

    def wait_in_air(self) -> None:
        """Wait until the vehicle has lifted off."""
        self.wait_for("lift-off", lambda: any((e.get("resource"), e.get("to_state")) == ("flight_status", "IN_AIR") for e in self.events()))

    def words(self) -> str:
        """What the flight printed so far."""
        return (self.out.parent / f"{self.out.name}.txt").read_text(encoding="utf-8")

    def end(self, code: int | None = None) -> None:
        """Wait for the flight's end; fail with its last words at another exit code than this one, or if any process of the run is left."""
        try:
            self.process.wait(FLIGHT_LIMIT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            end_run(self.run_id)
            pytest.fail(f"the flight did not end within {FLIGHT_LIMIT_S:.0f} s:\n{self.words()[-2000:]}")
        assert self.left_over() == {}
        if code not in {None, self.process.returncode}:
            pytest.fail(f"the flight's exit code is {self.process.returncode}, not {code}; its last words:\n{self.words()[-4000:]}")

    def left_over(self) -> Mapping[int, str]:
        """Return processes of the run that live although it has ended."""
        if not (self.out / "run.json").exists():
            return {}
        return {process.pid: " ".join(command_line(process)) for process in processes_of_run(self.run_id)}

    def give_up(self) -> None:
        """End whatever is left after a failed test."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()
        if (self.out / "run.json").exists():
            end_run(self.run_id)


def in_order(flight: Flight) -> list[Mapping[str, Any]]:
    """Return the executions of a flight's summary in the order of their requests.

    That is the mission's, as its record has it: managers stamp what arrives, and of two that are asked in one tick either may be first.
    """
    order = [
        entry.value["id"]
        for entry in read_record(flight.out / "skills.mcap")
        if entry.topic == DECISIONS and entry.value["kind"] == "start"
    ]
    return sorted(flight.summary["skills"], key=lambda execution: order.index(execution["id"]))


def story(flight: Flight) -> list[tuple[str, str, str]]:
    """Return skill, outcome and result of all executions in the order of their requests."""
    return [(e["skill"], e["outcome"], e["result"]) for e in in_order(flight)]


def with_mission(checkout: Path, name: str, text: str) -> Path:
    """Make a checkout of links in a folder, with another mission file of this name in it; what was built is shared."""
    checkout.mkdir()
    for entry in ALULA_ROOT.iterdir():
        if entry.name not in {".alula", ".git", "missions", "runs", "setup"}:
            (checkout / entry.name).symlink_to(entry)
    shutil.copytree(ALULA_ROOT / "setup", checkout / "setup")  # its scripts find the checkout by where they are
    shutil.copytree(ALULA_ROOT / "missions", checkout / "missions")
    (checkout / "missions" / name).write_text(text, encoding="utf-8")
    return checkout


def start_flight(out: Path, *arguments: str, scenario: str = "mapping", checkout: Path = ALULA_ROOT) -> Flight:
    """Start ``./alula fly SCENARIO ARGUMENTS`` as fast as the machine can, as a user's shell would; ``checkout``: of `with_mission`."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "PYTHON", "AMENT", "CMAKE", "LD_"))}
    command = [str(ALULA_ROOT / "alula"), "fly"]
    if checkout != ALULA_ROOT:
        environment = {k: v for k, v in environment.items() if not k.startswith("ALULA_")} | {"ALULA_STATE": str(_state())}
        command = [str(checkout / "setup/in_ros1"), "python3", "-m", "alula_flight.run"]
    with (out.parent / f"{out.name}.txt").open("w", encoding="utf-8") as words:
        process = subprocess.Popen(
            [*command, scenario, "--out", str(out), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=words,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
            cwd=checkout,
            start_new_session=True,
        )
    return Flight(process, out)


def _state() -> Path:
    return Path(os.environ.get("ALULA_STATE", ALULA_ROOT / ".alula"))
