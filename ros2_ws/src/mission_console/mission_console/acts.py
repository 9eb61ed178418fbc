"""What the operator can do: start a flight, have it stop and land, switch everything off."""

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

from alula_common.faults import FaultError, parse_fault
from alula_common.processes import end_run
from alula_common.runs import load_run, runs_folder
from alula_common.scenarios import scenario_names

ABORT_S = 5.0
"""How long (wall clock) the mission may take to answer."""
START_S = 20.0
LOOK_S = 0.05
MAX_FAULTS = 8
_WORD = re.compile(r"[A-Za-z0-9_:.@-]{1,60}")


class ActError(Exception):
    """What was asked for can't be done; the message says why."""


@dataclass(frozen=True)
class Flight:
    """A flight that is asked for."""

    scenario: str
    seed: int
    faults: tuple[str, ...]
    mock: bool

    def words(self, out: Path) -> list[str]:
        """Return the command line."""
        words = [str(Path(os.environ["ALULA_ROOT"]) / "alula"), "fly", self.scenario, "--seed", str(self.seed), "--out", str(out)]
        for fault in self.faults:
            words += ["--fail", fault]
        return [*words, *(["--mock"] if self.mock else [])]


def read_flight(asked: Mapping[str, object]) -> Flight:
    """Return the flight that a request describes.

    Raises:
        ActError: the request makes no sense.
    """
    scenario, seed, faults = asked.get("scenario"), asked.get("seed", 0), asked.get("faults", [])
    if scenario not in scenario_names():
        raise ActError(f"there is no scenario {scenario!r}; there are {', '.join(scenario_names())}")
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 2**31:
        raise ActError(f"the seed has to be a whole number from 0 to {2**31 - 1}")
    if not isinstance(faults, list) or len(faults) > MAX_FAULTS:
        raise ActError(f"faults are a list of at most {MAX_FAULTS}")
    for fault in faults:
        if not isinstance(fault, str) or not _WORD.fullmatch(fault):
            raise ActError(f"{fault!r} is no fault; one looks like zed@30 or zed:dark@30-40")
        try:
            parse_fault(fault)
        except FaultError as error:
            raise ActError(str(error)) from error
    return Flight(str(scenario), seed, tuple(faults), mock=asked.get("mock") is True)


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
        ActError: nobody answers.
    """
    from std_srvs.srv import Trigger

    from skill_runtime.ros2.session import Session

    session = Session("mission_console", domain=load_run(folder).domain)
    try:
        client = session.node.create_client(Trigger, "/mission/abort")
        if not client.wait_for_service(timeout_sec=ABORT_S):
            raise ActError("the mission does not answer; 'everything off' ends its processes")
        answer = client.call(Trigger.Request(), timeout_sec=ABORT_S)
    finally:
        session.close()
    if answer is None:
        raise ActError(f"the mission gave no answer within {ABORT_S:g} s")
    return str(answer.message)


def everything_off(folder: Path) -> str:
    """End all processes of a run at once, without landing; return what was done."""
    run_id = str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["run_id"])
    ended = end_run(run_id, patience_s=0.0)
    return f"{len(ended)} processes were ended at once"
