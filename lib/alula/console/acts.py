"""What the operator can do without the mission: start a flight, and switch everything off."""

from __future__ import annotations

import json
import os
import re
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from alula.common.faults import FaultError, parse_fault
from alula.common.located_yaml import YamlError, read_yaml
from alula.common.processes import end_run
from alula.common.robots import find_robot
from alula.common.runs import runs_folder
from alula.common.scenarios import scenario_names
from alula.console.link import ActError
from alula.report.ends import OPERATOR, Ended, note_end

START_S = 20.0
LOOK_S = 0.05
MAX_FAULTS = 8
VEHICLES = ("simulator", "mocks", "vehicle")
"""What can be flown: the simulator, mocks, or an autopilot at a MAVLink connection."""
_WORD = re.compile(r"[A-Za-z0-9_:.@-]{1,60}")
_WORLD = re.compile(r"[^\x00-\x1f-][^\x00-\x1f]{0,300}")
_CONNECTION = re.compile(r"[A-Za-z0-9/][A-Za-z0-9_./:\[\]-]{0,120}")


@dataclass(frozen=True)
class Flight:
    """A flight that is asked for. ``world``: a name or a file, empty for the scenario's; ``autopilot``: only of a vehicle."""

    scenario: str
    seed: int
    faults: tuple[str, ...] = ()
    world: str = ""
    vehicle: str = "simulator"
    autopilot: str = ""

    def words(self, out: Path) -> list[str]:
        """Return the command that starts this flight with ``out`` as the run's folder."""
        words = [str(Path(os.environ["ALULA_ROOT"]) / "alula"), "fly", self.scenario, "--seed", str(self.seed), "--out", str(out)]
        for fault in self.faults:
            words += ["--fail", fault]
        words += [f"--world={self.world}"] if self.world else []
        return [*words, *{"simulator": [], "mocks": ["--mock"], "vehicle": [f"--autopilot={self.autopilot}"]}[self.vehicle]]


def world_names() -> list[str]:
    """Return the worlds that come with the simulator; each holds a route."""
    worlds = find_robot().worlds
    return sorted(path.stem for path in worlds.glob("*.yaml"))


def read_flight(asked: Mapping[str, object]) -> Flight:
    """Return the flight that a request describes; what a world or a connection is worth, `alula fly` tells.

    Raises:
        ActError: the request makes no sense.
    """
    scenario, seed = asked.get("scenario"), asked.get("seed", 0)
    if scenario not in scenario_names():
        raise ActError(f"there is no scenario {scenario!r}; there are {', '.join(scenario_names())}")
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**31:
        raise ActError(f"the seed has to be a whole number from 0 to {2**31 - 1}")
    vehicle = asked.get("vehicle", "simulator")
    if vehicle not in VEHICLES:
        raise ActError(f"there is no vehicle {vehicle!r}; there are {', '.join(VEHICLES)}")
    world = _text(asked, "world", _WORLD, "is no world; give a name, or a file that does not begin with a dash")
    _check_world(world)
    autopilot = _text(asked, "autopilot", _CONNECTION, "is no MAVLink connection; one looks like udpin:127.0.0.1:14550 or /dev/ttyACM0")
    if (vehicle == "vehicle") != bool(autopilot):
        raise ActError("a vehicle, and only that, needs the MAVLink connection of its autopilot")
    return Flight(str(scenario), seed, _faults(asked.get("faults", [])), world, str(vehicle), autopilot)


def _check_world(world: str) -> None:
    """Refuse a file that is no world before `alula fly` does so: its messages quote what stands there, and any file can be asked for."""
    if not world or world in world_names():
        return
    path = Path(world)
    try:
        read = read_yaml(path) if path.is_file() else None
        known = {} if read is None else read.entries("a world")
    except (YamlError, OSError):
        known = {}
    if "route" not in known:
        raise ActError(
            f"{world} is no world: give one of {', '.join(world_names())}, or a YAML file on the robot's computer that has a route"
        )


def _text(asked: Mapping[str, object], name: str, pattern: re.Pattern[str], why: str) -> str:
    text = asked.get(name, "")
    if not isinstance(text, str) or (text and not pattern.fullmatch(text)):
        raise ActError(f"{text!r} {why}")
    return text


def _faults(faults: object) -> tuple[str, ...]:
    if not isinstance(faults, list) or len(faults) > MAX_FAULTS:
        raise ActError(f"faults are a list of at most {MAX_FAULTS}")
    for fault in faults:
        if not isinstance(fault, str) or not _WORD.fullmatch(fault):
            raise ActError(f"{fault!r} is no fault; one looks like zed@30 or zed:dark@30-40")
        try:
            parse_fault(fault)
        except FaultError as error:
            raise ActError(str(error)) from error
    return tuple(faults)


def start(flight: Flight) -> Path:
    """Start a flight and return its run's folder, as soon as that is there.

    The flight is a process of its own that this one does not end: a vehicle in the air must not fall because a page's server ended.

    Raises:
        ActError: it does not start; the message is its own.
    """
    out = runs_folder() / f"{datetime.now(tz=UTC).astimezone():%Y%m%d-%H%M%S}-{flight.scenario}"
    runs_folder().mkdir(parents=True, exist_ok=True)
    said = runs_folder() / f".{out.name}.log"
    with said.open("wb") as log:
        process = subprocess.Popen(flight.words(out), stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
    end = time.monotonic() + START_S
    while not (out / "run.json").exists() and not (out / "mission.json").exists() and time.monotonic() < end:
        if process.poll() is not None:
            words = said.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            raise ActError(words[-1] if words else f"alula fly ended with {process.returncode}")
        time.sleep(LOOK_S)
    return out


def everything_off(folder: Path) -> str:
    """End all processes of a run at once, without landing; return what was done."""
    note_end(folder, Ended(OPERATOR, "everything off"))
    run_id = str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["run_id"])
    ended = end_run(run_id, timeout_s=0.0)
    return f"{len(ended)} processes were ended at once"
