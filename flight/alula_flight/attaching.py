"""The front of a run on what runs already: the deployment's parts are there while it lasts, and afterwards as they were before."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from alula.common.processes import RUN_ID_VARIABLE
from alula.common.scenarios import load_scenario
from alula.report.aborts import RUNNING, last_account
from alula.runtime.live.spec import RequestError, RunSpec
from alula_flight.station import state as states
from alula_flight.station.master import why_no_master
from alula_flight.station.parts import environment_of
from alula_flight.station.station import Station

AT_REST_S = 90.0  # wall clock


@contextmanager
def attached_to(spec: RunSpec, say: Callable[[str], None]) -> Iterator[Mapping[str, str]]:
    """Have the deployment's parts run while the context lasts; yield the environment of the run.

    Those that ran before are left running, and it is said what of their models and code has changed since; the others end with the run,
    also where this process is killed.

    Raises:
        RequestError: the master does not answer, another mission runs, or a part can't run.
        StationError: the parts can't be begun.
    """
    station = Station(spec.deployment)
    why = why_no_master(station.deployment.master)
    if why:
        raise RequestError(
            f"no ROS master at {station.deployment.master}: {why}; start it, or correct `ros1: master` in {station.deployment.path}"
        )
    lock = states.take(station.folder / states.MISSION_LOCK)
    if lock is None:
        raise RequestError(f"{station.mission or 'another mission'} runs on {spec.deployment} already: one at a time")
    try:
        states.note_holder(lock, f"the mission {spec.scenario} in {spec.out_dir}")
        begun = not station.is_up
        for name, how in station.differences().items():
            say(f"{name} runs as it was started, and is another by now, {'; '.join(how)}: `alula up {spec.deployment}` takes that")
        if begun:
            station.begin(until=os.getpid())
        try:
            _check(station)
            yield {**environment_of(station.deployment, station.places, os.environ), RUN_ID_VARIABLE: spec.run_id}
        finally:
            if begun:
                station.end()
    finally:
        lock.close()


def _check(station: Station) -> None:
    """Refuse to begin where a part of the deployment is down; raises RequestError."""
    for name, part in station.settle().parts.items():
        if part.state != states.RUNNING:
            raise RequestError(
                f"{name} of {station.deployment.name} does not run ({part.state}): {part.why}; {station.places.logs / name}.log"
            )


def leave_at_rest(spec: RunSpec, say: Callable[[str], None]) -> None:
    """Interrupt what a mission has left running that ended before it could stop it: its managers live on."""
    out = Path(spec.out_dir)
    if last_account(out).get("outcome") not in {None, RUNNING}:
        return
    say("the mission did not end in order: what runs is interrupted")
    station = Station(spec.deployment)
    words = station.places.in_ros2("interrupt_all", "python", "-m", "skillset_ros2.interrupt_all", *load_scenario(spec.scenario).skillsets)
    with (out / "logs" / "interrupt_all.log").open("wb") as said:
        environment = environment_of(station.deployment, station.places, os.environ)
        try:
            code = subprocess.run(
                words, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=said, timeout=AT_REST_S, check=False
            ).returncode
        except subprocess.TimeoutExpired:
            code = 1
    if code:
        say(f"not all of it stopped: look at the robot; {out / 'logs' / 'interrupt_all.log'} says what did not")
