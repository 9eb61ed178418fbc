"""What the operator can do: start a flight, have it pause and go on, have it stop and land, switch everything off."""

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
from typing import Any

from alula.common.faults import FaultError, parse_fault
from alula.common.processes import end_run
from alula.common.runs import load_run, runs_folder
from alula.common.scenarios import scenario_names

ANSWER_S = 5.0
"""How long (wall clock) the mission may take to answer."""
START_S = 20.0
LOOK_S = 0.05
MAX_FAULTS = 8
VEHICLES = ("simulator", "mocks", "vehicle")
"""What can be flown: the simulator, mocks, or an autopilot at a MAVLink connection."""
_WORD = re.compile(r"[A-Za-z0-9_:.@-]{1,60}")
_WORLD = re.compile(r"[^\x00-\x1f-][^\x00-\x1f]{0,300}")
_CONNECTION = re.compile(r"[A-Za-z0-9/][A-Za-z0-9_./:\[\]-]{0,120}")


class ActError(Exception):
    """What was asked for can't be done; the message says why."""


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
        """Return the command line."""
        words = [str(Path(os.environ["ALULA_ROOT"]) / "alula"), "fly", self.scenario, "--seed", str(self.seed), "--out", str(out)]
        for fault in self.faults:
            words += ["--fail", fault]
        words += [f"--world={self.world}"] if self.world else []
        return [*words, *{"simulator": [], "mocks": ["--mock"], "vehicle": [f"--autopilot={self.autopilot}"]}[self.vehicle]]


def world_names() -> list[str]:
    """Return the worlds that come with the simulator; each holds a route."""
    worlds = Path(os.environ["ALULA_ROOT"]) / "ros1_ws" / "src" / "uav_simulator" / "worlds"
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
    autopilot = _text(asked, "autopilot", _CONNECTION, "is no MAVLink connection; one looks like udpin:127.0.0.1:14550 or /dev/ttyACM0")
    if (vehicle == "vehicle") != bool(autopilot):
        raise ActError("a vehicle, and only that, needs the MAVLink connection of its autopilot")
    return Flight(str(scenario), seed, _faults(asked.get("faults", [])), world, str(vehicle), autopilot)


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


def abort(folder: Path) -> str:
    """Have the mission of a run stop and land; return what it answers.

    Raises:
        ActError: the mission does not answer.
    """
    from std_srvs.srv import Trigger

    return str(_ask_mission(folder, Trigger, "/mission/abort", Trigger.Request()).message)


def pause(folder: Path) -> str:
    """Have the mission of a run hold; raise ActError where it can't, or does not answer."""
    return _set_paused(folder, paused=True)


def resume(folder: Path) -> str:
    """Have the mission of a run go on; raise ActError where it can't, or does not answer."""
    return _set_paused(folder, paused=False)


def _set_paused(folder: Path, *, paused: bool) -> str:
    from std_srvs.srv import SetBool

    answer = _ask_mission(folder, SetBool, "/mission/pause", SetBool.Request(data=paused))
    if not answer.success:
        raise ActError(str(answer.message))
    return str(answer.message)


def _ask_mission(folder: Path, kind: Any, service: str, request: Any) -> Any:
    """Call a service of the mission of a run; raise ActError."""
    from skillset_ros2.session import Session

    session = Session("alula.console", domain=load_run(folder).domain)
    try:
        client = session.node.create_client(kind, service)
        if not client.wait_for_service(timeout_sec=ANSWER_S):
            raise ActError("the mission does not answer; 'everything off' ends its processes")
        answer = client.call(request, timeout_sec=ANSWER_S)
    finally:
        session.close()
    if answer is None:
        raise ActError(f"the mission gave no answer within {ANSWER_S:g} s")
    return answer


def everything_off(folder: Path) -> str:
    """End all processes of a run at once, without landing; return what was done."""
    run_id = str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["run_id"])
    ended = end_run(run_id, patience_s=0.0)
    return f"{len(ended)} processes were ended at once"
