"""What roslaunch is asked to start for a run: a scenario's launch file, and its arguments."""

from __future__ import annotations

from alula.common.faults import parse_fault
from alula.common.operator import is_operator
from alula.common.robots import find_robot
from alula.common.scenarios import Scenario, load_scenario
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RequestError, RunSpec


def launch_file(scenario: Scenario) -> str:
    """Return the file that a scenario names; raises RequestError."""
    from roslib.packages import find_resource  # late: importing this module needs no ROS

    if not scenario.launch:
        raise RequestError(
            f"the scenario {scenario.name} names no `launch`, so there is nothing to start; add `launch: package/file.launch`, or --mock"
        )
    found: list[str] = find_resource(*scenario.launch.split("/"))
    if not found:
        raise RequestError(f"the scenario {scenario.name} names {scenario.launch}, which no ROS 1 package of the robot has")
    return found[0]


def launch_arguments(spec: RunSpec, part: RunPart) -> list[str]:
    """Return the arguments of the scenario's launch file; faults of processes are the supervisor's own, and an operator is a process."""
    processes = dict(load_scenario(spec.scenario).processes)
    operator = [fault for fault in spec.faults if is_operator(parse_fault(fault))]
    faults = [fault for fault in spec.faults if fault not in operator and parse_fault(fault).what not in processes]
    of_every_robot = {"scenario": spec.scenario, "out": spec.out_dir, "seed": spec.seed, "faults": ",".join(faults)}
    world = {"world": spec.world} if spec.world else {}
    acts = {"operator": ",".join(operator)} if operator else {}
    groot = {"groot": spec.groot} if spec.groot else {}
    # The mission of a fleet has the clock of its robots where it has their simulators, which wait for it.
    clock: dict[str, object] = {"heartbeat": False} if spec.commanded else {}
    if find_robot().robots:
        clock = {"heartbeat": bool(spec.members), "use_sim_time": bool(spec.members)}
    return [
        f"{name}:={value}" for name, value in {**of_every_robot, **world, **acts, **groot, **clock, **part.launch_arguments(spec)}.items()
    ]
