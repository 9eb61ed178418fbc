"""``alula up``, ``down``, ``status`` and ``service``: what of a deployment stays up between missions."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import psutil

from alula.cli.table import parse
from alula.common.deployments import MANAGERS, DeploymentError, deployment_names
from alula.common.errors import AlulaError
from alula.common.suggestions import nearest
from alula_flight.station import state as states
from alula_flight.station.master import why_no_master
from alula_flight.station.service import service
from alula_flight.station.state import StationState
from alula_flight.station.station import Station, StationError

DONE, DOWN, WRONG = 0, 1, 2
OF_A_PART = ("pid", "state", "deaths", "why")


def say(line: str) -> None:
    """Say what happens, on standard error."""
    sys.stderr.write(f"{line}\n")


def up(given: Any) -> int:
    """Start what does not run, and what is to be started again; return 0 when all of it runs, else 1."""
    station = Station(given.deployment)
    for name in given.restart:
        if name not in station.deployment.parts:
            by = next((part for part, skillsets in station.deployment.served.items() if name in skillsets), "")
            hint = f"the part {by} serves it, with all others there" if by else nearest(name, station.deployment.parts)
            raise StationError(f"--restart {name}: {hint or 'it has no such part'}")
    mission = station.mission
    if mission:
        raise StationError(f"{mission} runs on {given.deployment}: its parts are left alone until it is over")
    why = why_no_master(station.deployment.master)
    if why:
        say(f"no ROS master at {station.deployment.master}: {why}; the bridge waits for it")
    was_up, differing = station.is_up, station.differences()
    for name, how in differing.items():
        say(f"{name} is started again, {'; '.join(how)}")
    if not was_up:
        station.begin()
    if was_up or differing or given.restart:
        station.ask(given.restart)
    state = station.settle()
    sys.stdout.write("".join(f"{line}\n" for line in lines_of(station, state)))
    return DONE if all(part.state == states.RUNNING for part in state.parts.values()) else DOWN


def down(given: Any) -> int:
    """End what ``up`` has started; return 0."""
    station = Station(given.deployment or the_only_one())
    mission = station.mission
    if mission and not given.now:
        raise StationError(f"{mission} runs: end it first (Ctrl-C, or the operator's page), or end all under it with --now")
    station.end()
    say(f"{station.deployment.name} is down")
    return DONE


def status(given: Any) -> int:
    """Tell how a deployment's parts are; return 0 when all of them run, else 1."""
    station = Station(given.deployment or the_only_one())
    state = station.state()
    if given.json:
        sys.stdout.write(json.dumps(told(station, state)) + "\n")
    else:
        sys.stdout.write("".join(f"{line}\n" for line in lines_of(station, state)))
    return DONE if station.is_up and all(part.state == states.RUNNING for part in state.parts.values()) else DOWN


def the_only_one() -> str:
    """Return the robot's deployment where it has only one; raises DeploymentError."""
    names = deployment_names()
    if len(names) != 1:
        raise DeploymentError(
            f"name a deployment: {', '.join(names)}" if names else "this robot has no deployment: docs/how-to/on-the-robot.md"
        )
    return names[0]


def told(station: Station, state: StationState) -> dict[str, object]:
    """Return how a deployment is, as JSON has it."""
    parts: Mapping[str, Any] = {
        name: {"lasting_s": states.lasting_s(part.start) if part.pid else None, **{key: getattr(part, key) for key in OF_A_PART}}
        for name, part in state.parts.items()
    }
    return {
        "deployment": station.deployment.name,
        "up": station.is_up,
        "master": station.deployment.master,
        "master_problem": why_no_master(station.deployment.master),
        "domain": station.deployment.domain,
        "mission": station.mission,
        "page": page_address(station),
        "disk": state.disk,
        "clock_ahead_s": state.master.get("ahead_s") if station.is_up else None,
        "logs": str(station.places.logs),
        "parts": parts,
    }


def lines_of(station: Station, state: StationState) -> list[str]:
    """Return how a deployment is, a line each."""
    said = told(station, state)
    left = any(part.pid for part in state.parts.values())
    how = "up" if said["up"] else "what keeps it up has died, and `alula up` or `down` goes on with what runs" if left else "down"
    lines = [f"{said['deployment']}: {how}; DDS domain {said['domain']}, ROS master {said['master']}"]
    if said["master_problem"]:
        lines.append(f"  the ROS master does not answer: {said['master_problem']}")
    for name, part in state.parts.items():
        lasting = f" for {states.lasting_s(part.start):.0f} s, process {part.pid}" if part.pid else ""
        deaths = f"; ended {part.deaths} times by itself, last with {part.why}" if part.deaths else ""
        of = f" of {', '.join(station.deployment.served[name])}" if name == MANAGERS and name in station.deployment.served else ""
        lines.append(f"  {name}{of}: {part.state}{lasting}{deaths}")
    lines += [f"  mission: {said['mission'] or 'none'}"] if said["up"] else []
    lines += [f"  page: {said['page']}"] if said["page"] else []
    lines += [f"  disk: {said['disk']}"] if said["disk"] else []
    lines += [f"  clock of the master's computer: {said['clock_ahead_s']:+.3f} s from ours"] if said["clock_ahead_s"] is not None else []
    return [*lines, f"  logs: {said['logs']}"]


def page_address(station: Station) -> str:
    """Return the address that the page has said last; empty where it does not run."""
    page = station.state().parts.get("page")
    if page is None or not page.pid:
        return ""
    try:
        words = (Path(station.places.logs) / "page.log").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return next((word for word in reversed(words) if word.startswith(("http://", "https://"))), "")


ACTS: Mapping[str, Callable[[Any], int]] = {"up": up, "down": down, "status": status, "service": service}


def main(arguments: Sequence[str]) -> int:
    """Do what the command line says; return the exit code."""
    name, *words = arguments
    given = parse(name, words)
    try:
        return ACTS[name](given)
    except (AlulaError, OSError, psutil.Error) as error:
        sys.stderr.write(f"alula {name}: {error}\n")
        return WRONG


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
