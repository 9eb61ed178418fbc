"""Keeps a deployment's parts up: ``python -m alula_flight.station.keeper DEPLOYMENT [--until PID]``, started by ``alula up`` or systemd.

1. take over what still runs of an earlier keeper     3. start again what ends by itself, not for ever
2. start the rest, in order                           4. when told to end, end all of it, in the opposite order

SIGHUP: read the deployment again, do what ``wanted.json`` asks for, start what is down. SIGTERM, SIGINT: end. A part that says itself
that it can't run (exit code 2) and one that dies `DEATHS` times in `WITHIN_S` stay down until the next SIGHUP.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import os
import signal
import subprocess
import sys
import time
import uuid
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import psutil

from alula.common.deployments import Deployment, load_deployment
from alula.common.errors import AlulaError
from alula.common.files import write_json, write_text
from alula.common.network import DOMAINS, NoFreeDomainError, claim_domain
from alula.common.processes import end_run
from alula.common.robots import RobotFolder, find_robot
from alula.common.signals import StopEvent
from alula.report.deaths import describe_exit
from alula_flight.station import state as states
from alula_flight.station.contents import changes, with_contents
from alula_flight.station.disk import tidy
from alula_flight.station.master import MasterWatch
from alula_flight.station.notify import notify
from alula_flight.station.parts import PROFILE, Part, Places, network_profile, parts_of, places_of
from alula_flight.station.state import PartState, StationState

DEATHS, WITHIN_S = 5, 60.0
AGAIN_S, LIVES_S, LOOK_S = 0.5, 3.0, 0.2  # until a part is started again, until it counts as up, and how often it is looked
TIDY_S = 60.0
LOG_BYTES = 20_000_000
END_S = ((signal.SIGINT, 15.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 5.0))
"""How a part is told to end, and how long it may take (wall clock)."""
CANT_RUN = 2
RUN = "run.json"
GRAPH = (
    "ROS_MASTER_URI",
    "ROS_IP",
    "ROS_HOSTNAME",
    "ROS_DOMAIN_ID",
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "ROS_STATIC_PEERS",
    "ALULA_NAMESPACE",
)

log = logging.getLogger("alula.station")


def end_process(process: psutil.Process) -> None:
    """End a part's process: politely first."""
    for number, timeout_s in END_S:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.send_signal(number)
        if not psutil.wait_procs([process], timeout=timeout_s)[1]:
            return


def end_all(state: StationState) -> None:
    """End all parts in the opposite order of their start, and what else carries their id."""
    for part in reversed(state.parts.values()):
        process = part.process
        if process is not None:
            end_process(process)
        part.pid, part.state = 0, states.ENDED
    if state.run_id:
        end_run(state.run_id)


class Kept:
    """One part, kept up."""

    def __init__(self, part: Part, state: PartState, places: Places) -> None:
        self.part = part
        self.state = state
        self._places = places
        self._child: subprocess.Popen[bytes] | None = None
        self._due_s = 0.0
        self._begun_s = time.monotonic()
        self._died_s: deque[float] = deque(maxlen=DEATHS)

    @property
    def differs(self) -> bool:
        """Return whether what runs is not what the deployment, its models and its code say by now."""
        return self.state.process is not None and bool(differences(self.state, self.part))

    @property
    def log(self) -> Path:
        """Return the file of its words."""
        return self._places.logs / f"{self.part.name}.log"

    def forgive(self) -> None:
        """Count no earlier deaths, and have it start at once where it is down."""
        self._died_s.clear()
        if self.state.process is None:
            self.state.state, self._due_s = states.WAITING, 0.0

    def end(self) -> None:
        """End its process."""
        process = self.state.process
        if process is not None:
            end_process(process)
        self._child, self.state.pid, self.state.state, self._due_s = None, 0, states.WAITING, 0.0

    def look(self) -> bool:
        """Start it where that is due, and note its end; tell whether something has changed."""
        before = (self.state.state, self.state.pid)
        if self.state.pid and self._has_ended():
            self._note_end()
        elif self.state.pid:
            if self.state.state == states.STARTING and time.monotonic() - self._begun_s >= LIVES_S:
                self.state.state = states.RUNNING
        elif self.state.state in {states.WAITING, states.STARTING} and time.monotonic() >= self._due_s:
            self._start()
        return before != (self.state.state, self.state.pid)

    def cut_log(self) -> None:
        """Begin its log anew where that has become long; the last one is kept beside it. The process goes on in the same file."""
        with contextlib.suppress(OSError):
            if self.log.stat().st_size > LOG_BYTES:
                self.log.with_suffix(".1.log").write_bytes(self.log.read_bytes())
                os.truncate(self.log, 0)

    def _start(self) -> None:
        with self.log.open("ab") as said:
            self._child = subprocess.Popen(
                self.part.words,
                env=dict(self.part.environment),
                cwd=self._places.folder,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                start_new_session=True,
            )
        self.state.pid, self.state.state = self._child.pid, states.STARTING
        self.state.words, self.state.graph, self.state.contents = self.part.words, graph_of(self.part), self.part.contents
        self._begun_s = time.monotonic()
        self.state.start = states.start_of(self._child.pid)
        log.info("%s is started, process %d", self.part.name, self._child.pid)

    def _has_ended(self) -> bool:
        # One that is killed looks dead before all of its threads are, which is when it tells how it ended.
        return self.state.process is None if self._child is None else self._child.poll() is not None

    def _note_end(self) -> None:
        code = None if self._child is None else self._child.poll()
        how = "its end was not seen" if self._child is None else describe_exit(code)
        self._child, self.state.pid = None, 0
        self.state.deaths += 1
        self._died_s.append(time.monotonic())
        self.state.why = f"{how}: {self._last_words()}"
        if code == CANT_RUN:
            self.state.state = states.REFUSED
        elif len(self._died_s) == DEATHS and self._died_s[-1] - self._died_s[0] < WITHIN_S:
            self.state.state = states.GIVEN_UP
        else:
            self.state.state, self._due_s = states.WAITING, time.monotonic() + AGAIN_S
        log.error("%s has ended (%s)", self.part.name, self.state.why)

    def _last_words(self) -> str:
        with contextlib.suppress(OSError):
            lines = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            return lines[-1][:300] if lines else "it said nothing"
        return "it said nothing"


def graph_of(part: Part) -> dict[str, str]:
    """Return what a part's environment says of the graph."""
    return {name: part.environment[name] for name in GRAPH if name in part.environment}


def differences(state: PartState, part: Part) -> list[str]:
    """Say in what a part that runs differs from what it would be now."""
    graph = changes(state.graph, graph_of(part))
    return [*(["another command"] if state.words != part.words else []), *graph, *changes(state.contents, part.contents)]


class Keeper:
    """All parts of a deployment, from the start of the first to the end of the last; raises AlulaError where they can't be."""

    def __init__(self, robot: RobotFolder, deployment: Deployment, places: Places) -> None:
        self._robot = robot
        self._deployment = deployment
        self._places = places
        self._state = StationState.load(places.folder)
        self._state.run_id = self._state.run_id or uuid.uuid4().hex
        self._state.keeper, self._state.keeper_start = os.getpid(), states.start_of(os.getpid())
        self._kept: dict[str, Kept] = {}
        self._master = MasterWatch(deployment.master)
        self._tidy_s = 0.0
        self.hung_up = False
        for folder in (places.logs, places.bags):
            folder.mkdir(parents=True, exist_ok=True)
        self._read()
        for one in self._kept.values():
            one.forgive()

    def turn(self) -> None:
        """Do what is due."""
        changed = self.hung_up
        if self.hung_up:
            self.hung_up = False
            self._do_wanted()
        for one in list(self._kept.values()):
            changed |= one.look()
        known = self._master.told()
        if known != self._state.master:
            self._state.master, changed = known, True
        if time.monotonic() >= self._tidy_s:
            self._tidy_s = time.monotonic() + TIDY_S
            self._tidy()
            changed = True
        if changed:
            self._state.save(self._places.folder)

    def end(self) -> None:
        """End all parts."""
        end_all(self._state)
        self._master.close()
        (self._places.folder / RUN).unlink(missing_ok=True)
        self._state.keeper = 0
        self._state.save(self._places.folder)

    def _as_a_run(self) -> dict[str, object]:
        """Return what finds the skillsets here as those of a run: a run without a scenario, as long as the deployment is up."""
        return {
            "scenario": "",
            "deployment": self._deployment.name,
            "domain": self._deployment.domain,
            "namespace": self._deployment.namespace,
            "run_id": self._state.run_id,
            "robot": str(self._robot.root),
        }

    def _read(self) -> None:
        """Take the parts as the deployment has them; what it has no more is ended."""
        deployment, folder = self._deployment, self._places.folder
        profile = (self._places.root / "bridge" / PROFILE).read_text(encoding="utf-8")
        write_text(folder / PROFILE, network_profile(deployment, profile))
        write_json(folder / RUN, self._as_a_run())
        plain = parts_of(deployment, self._places, self._state.run_id, os.environ)
        parts = {part.name: part for part in with_contents(plain, deployment, self._places, self._robot)}
        for name in [name for name in self._state.parts if name not in parts]:
            process = self._state.parts.pop(name).process
            self._kept.pop(name, None)
            if process is not None:
                end_process(process)
        self._state.parts = {name: self._state.parts.get(name, PartState()) for name in parts}
        for name, part in parts.items():
            if name in self._kept:
                self._kept[name].part = part
            else:
                self._kept[name] = Kept(part, self._state.parts[name], self._places)
        self._kept = {name: self._kept[name] for name in parts}

    def _do_wanted(self) -> None:
        restart, number = read_wanted(self._places.folder)
        try:
            self._deployment = load_deployment(self._deployment.name, self._robot)
            self._read()
            if self._master.uri != self._deployment.master:
                self._master.close()
                self._master = MasterWatch(self._deployment.master)
        except AlulaError as error:
            log.error("the deployment stays as it was: %s", error)
        for name, one in self._kept.items():
            if name in restart or one.differs:
                log.info("%s is ended, and started again", name)
                one.end()
            one.forgive()
            one.look()
        self._state.answered = number

    def _tidy(self) -> None:
        for one in self._kept.values():
            one.cut_log()
        try:
            self._state.disk = tidy(self._robot.runs, self._places.bags, self._deployment.name, self._deployment.disk_gb)
        except OSError as error:
            self._state.disk = f"the disk can't be looked at: {error.strerror}"


def read_wanted(folder: Path) -> tuple[set[str], int]:
    """Return what was asked for last: parts to be started again, and the request's number."""
    try:
        said = json.loads((folder / states.WANTED).read_text(encoding="utf-8"))
        return {str(one) for one in said["restart"]}, int(said["number"])
    except (OSError, ValueError, KeyError, TypeError):
        return set(), 0


def main(arguments: Sequence[str]) -> int:
    """Keep the parts up until told to end; return the exit code."""
    parser = argparse.ArgumentParser(prog="keeper")
    parser.add_argument("deployment")
    parser.add_argument("--until", type=int, default=0, metavar="PID", help="end when this process has ended")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    stop = StopEvent()
    try:
        robot = find_robot()
        deployment = load_deployment(given.deployment, robot)
        places = places_of(deployment, robot)
        lock = states.take(places.folder / states.KEEPER_LOCK)
        if lock is None:
            sys.stderr.write(f"alula up: {deployment.name} is kept up by another process already; alula status {deployment.name}\n")
            return CANT_RUN
        states.note_holder(lock, f"the keeper of {deployment.name}")
        front = psutil.Process(given.until) if given.until else None  # knows its process by its start, too: ids are used again
        claim = claim_domain([deployment.domain], deployment.namespace) if deployment.domain in DOMAINS else None
        keeper = Keeper(robot, deployment, places)
    except (AlulaError, NoFreeDomainError, OSError, psutil.Error) as error:
        sys.stderr.write(f"alula up: {error}\n")
        return CANT_RUN
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    signal.signal(signal.SIGHUP, lambda *_: setattr(keeper, "hung_up", True))
    notify("READY=1")
    while not stop.is_set() and (front is None or front.is_running()):
        keeper.turn()
        notify("WATCHDOG=1")
        stop.wait(LOOK_S)
    notify("STOPPING=1")
    keeper.end()
    if claim is not None:
        claim.release()
    lock.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
