"""``alula doctor DEPLOYMENT [--json]``: find in 20 s what is wrong with a deployment, in the order in which one would look.

1. the parts that should run here      4. the nodes, from here and back   7. the clocks
2. the names that its file has         5. what the bridge is to carry     8. the disk
3. the ROS 1 master                    6. ROS 2

Starts, ends and mends nothing. Exit code 0: nothing has to be mended; 1: something has; 2: it can't be looked at.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import psutil

from alula.cli.table import parse
from alula.common.deployments import Deployment, deployment_names
from alula.common.errors import AlulaError
from alula.common.fast_dds import PROFILE_VARIABLES
from alula.common.files import json_line, write_text
from alula.common.robots import RobotFolder, find_robot
from alula_flight.doctor.base import foreign, look_at_master, look_at_nodes, look_at_way_back
from alula_flight.doctor.bindings import look_at_bindings
from alula_flight.doctor.clock import look_at_clock
from alula_flight.doctor.dds import look_at_graph, look_at_reach, look_at_shared_memory
from alula_flight.doctor.disk import look_at_disk
from alula_flight.doctor.findings import AREAS, BINDINGS, CLOCK, NODES, PARTS, Finding, Level, any_problem, lines_of, note, ok, problem
from alula_flight.doctor.names import look_at_names
from alula_flight.station import state as states
from alula_flight.station.parts import PROFILE, environment_of, network_profile
from alula_flight.station.station import Station

FINE, FOUND, WRONG = 0, 1, 2


def look_at_parts(station: Station) -> Iterator[Finding]:
    """Yield how the parts are that should run here, and who else serves them on this computer."""
    name, state = station.deployment.name, station.state()
    if not station.is_up:
        yield note(PARTS, f"{name} is not up: what it would start is not looked at", f"alula up {name}")
    for part, one in state.parts.items():
        if one.state in {states.REFUSED, states.GIVEN_UP}:
            log = station.places.logs / f"{part}.log"
            yield problem(PARTS, f"{part} does not run ({one.state}): {one.why}", f"{log} says more; then alula up {name}")
        elif one.pid:
            yield ok(PARTS, f"{part} runs, process {one.pid}{f'; it has died {one.deaths} times' if one.deaths else ''}")
    for other in deployment_names():
        beside = None if other == name else Station(other)
        twice = [] if beside is None else sorted(_work(beside.deployment) & _work(station.deployment))
        if beside is not None and twice and beside.is_up and beside.deployment.domain == station.deployment.domain:
            what = f"{other} is up in the same DDS domain, and serves {', '.join(twice)}, too"
            yield problem(PARTS, what, f"alula down {other}, or give one of the two another `domain`")


def _work(deployment: Deployment) -> set[str]:
    """Return what only one deployment in a graph can do: serve a skillset, and carry what crosses."""
    return {*deployment.managers, *(["bridge"] if deployment.bridge else [])}


def examine(station: Station, robot: RobotFolder) -> list[Finding]:
    """Look at everything, and return what was found, in order."""
    deployment, places = station.deployment, station.places
    profile = _take_environment(station)
    running = [name for name, part in station.state().parts.items() if part.pid]
    with ThreadPoolExecutor() as pool:
        clock = pool.submit(look_at_clock, deployment.master)
        back = pool.submit(look_at_way_back, deployment)
        graph = pool.submit(lambda: list(look_at_graph(deployment, running)))
        found = [*look_at_parts(station), *look_at_names(deployment)]
        said, base = look_at_master(deployment)
        found += said
        if base is None:
            found += [note(area, "not looked at: there is no master") for area in (NODES, BINDINGS, CLOCK)]
        else:
            nodes, reached = look_at_nodes(base)
            found += [*nodes, back.result(), *look_at_bindings(deployment, places, robot, base, reached), clock.result()]
            bridges = foreign(base.uris, bridges=True)
            if len(bridges) > 1:
                what = f"{len(bridges)} bridges are at this master ({', '.join(sorted(bridges))}): what crosses comes twice"
                found.append(problem(NODES, what, "end all but one"))
        found += [*look_at_reach(deployment, profile), look_at_shared_memory(len(deployment.parts)), *graph.result()]
    found += look_at_disk(deployment, places, robot)
    return sorted(found, key=lambda one: AREAS.index(one.area))


def _take_environment(station: Station) -> str:
    """Give this process the environment of the deployment's parts; return the text of the profile that Fast DDS has in it."""
    deployment, places = station.deployment, station.places
    usual = (places.root / "bridge" / PROFILE).read_text(encoding="utf-8")
    environment = environment_of(deployment, places, os.environ)
    path = Path(environment.get(PROFILE_VARIABLES[0], ""))
    if path.parent == places.folder:  # as `alula up` writes it
        write_text(path, network_profile(deployment, usual))
    os.environ.clear()
    os.environ.update({**environment, **dict.fromkeys(PROFILE_VARIABLES, str(path))})
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def main(arguments: Sequence[str]) -> int:
    """Do what the command line says; return the exit code."""
    given, begun_s = parse("doctor", arguments), time.monotonic()
    try:
        robot = find_robot()
        findings = examine(Station(given.deployment), robot)
    except (AlulaError, OSError, psutil.Error) as error:
        sys.stderr.write(f"alula doctor: {error}\n")
        return WRONG
    if given.json:
        every = [{**asdict(one), "level": one.level.value} for one in findings]
        took_s = round(time.monotonic() - begun_s, 1)
        sys.stdout.write(json_line({"deployment": given.deployment, "took_s": took_s, "findings": every}))
    else:
        bad = sum(one.level is Level.PROBLEM for one in findings)
        sys.stdout.write("".join(f"{line}\n" for line in lines_of(findings)))
        sys.stdout.write(f"{bad} to be mended, see above\n" if bad else "all is well\n")
    return FOUND if any_problem(findings) else FINE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
