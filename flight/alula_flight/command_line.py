"""The command line of a live ``alula run``: read, checked, and made into a specification."""

from __future__ import annotations

import argparse
import os
import sys
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import replace

from alula.cli.options.runs import fleet_run
from alula.cli.run_request import check_limit, check_seed, groot_address, run_folder, world_file
from alula.cli.table import parser_of
from alula.common.deployments import load_deployment
from alula.common.faults import FaultError, parse_fault
from alula.common.network import DOMAINS, NAMESPACE, DomainClaim, free_port
from alula.common.robots import find_robot, fleet_name
from alula.common.scenarios import Scenario, ScenarioError, load_scenario
from alula.common.suggestions import with_nearest
from alula.runtime.live import options
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RequestError, RunSpec
from alula_flight.launch import launch_file
from alula_flight.station.parts import DEPLOYMENT_VARIABLE

MASTER, USUAL_MASTER = "ROS_MASTER_URI", "ALULA_USUAL_MASTER"
"""Variables: the ROS 1 master, and the one that `setup/env.sh` has put there because the caller exports none."""


def check_no_master(environment: Mapping[str, str]) -> None:
    """Refuse to start a graph of its own where the caller has exported the master of another one; raises RequestError."""
    master = environment.get(MASTER, "")
    if master and master != environment.get(USUAL_MASTER):
        raise RequestError(
            f"{MASTER} is {master}, and a run without --on has a master of its own: name a deployment to run on what is there "
            f"(--on NAME), or leave the variable out (env -u {MASTER} alula run ...)"
        )


def parse(arguments: Sequence[str], part: RunPart) -> RunSpec:
    """Turn the command line into a specification; raise RequestError, or exit 2 as argparse does."""
    parser = parser_of("run")
    deployment = deployment_of(arguments)
    if find_robot().robots:
        fleet_run(parser)
    if not deployment:
        part.add_options(parser)
    if options.FLAG in arguments:
        sys.stdout.write(f"{options.as_json(part)}\n")
        parser.exit()
    given = parser.parse_args(arguments)
    if given.behaviour:
        raise RequestError("--behaviour is for mocks; add --mock")
    if deployment:
        return attached(given, deployment)
    scenario = read_scenario(given.scenario)
    if given.commanded and scenario.mission:
        raise RequestError(f"--commanded: the scenario {scenario.name} has a mission; name one without, that serves its skills only")
    seed, world = check_seed(given.seed), world_file(scenario, given.world)
    part.check_world(world)
    own = part.read(given, scenario)
    robots = find_robot().robots
    if robots and given.served and not given.domain:
        raise RequestError("--served: say in which DDS domain the robots are, with --domain N")
    members = {} if not robots or given.served else member_words(scenario, given.fail, given.options)
    return RunSpec(
        scenario=given.scenario,
        out_dir=str(run_folder(given.out, given.scenario)),
        run_id=uuid.uuid4().hex,
        seed=seed,
        faults=read_faults(given.fail, None if robots else {**options.offer_of(part).faults, **dict(scenario.faults)}),
        world=world,
        master_port=free_port(),
        domain=read_domain(given.domain),
        namespace=read_namespace(given.namespace or (find_robot().name if robots else "")),
        console=given.console,
        monitor=given.monitor,
        limit_s=check_limit(given.limit),
        commanded=given.commanded,
        members=members,
        groot=groot_address(given.groot),
        robot=str(find_robot().root),
        own=own,
    )


def deployment_of(arguments: Sequence[str]) -> str:
    """Return the deployment that a run is to be on: where none is named, the one that this process belongs to, as the page does."""
    on = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    on.add_argument("--on", default=os.environ.get(DEPLOYMENT_VARIABLE, ""))
    return str(on.parse_known_args(arguments)[0].on)


def attached(given: argparse.Namespace, name: str) -> RunSpec:
    """Return the specification of a run on what runs already; raises RequestError, DeploymentError."""
    deployment = load_deployment(name)
    scenario = load_scenario(given.scenario)
    if not scenario.mission:
        raise RequestError(f"the scenario {scenario.name} has no mission: `alula up {name}` alone serves the skills")
    if find_robot().robots:
        raise RequestError("--on: a fleet has no deployment of its own; each of its robots has: alula up, with --robot DIR")
    for option, value in {"--fail": given.fail, "--commanded": given.commanded}.items():
        if value:
            raise RequestError(f"{option}: is of runs with a graph of their own; on what runs already nothing is made to fail or to wait")
    for option, value in {"--domain": given.domain, "--namespace": given.namespace}.items():
        if value:
            raise RequestError(f"{option}: the deployment says it, in {deployment.path}")
    return RunSpec(
        scenario=scenario.name,
        out_dir=str(run_folder(given.out, scenario.name)),
        run_id=uuid.uuid4().hex,
        seed=check_seed(given.seed),
        world=world_file(scenario, given.world),
        domain=deployment.domain,
        namespace=deployment.namespace,
        console=given.console,
        monitor=given.monitor,
        limit_s=check_limit(given.limit),
        groot=groot_address(given.groot),
        deployment=name,
        robot=str(find_robot().root),
    )


def member_words(scenario: Scenario, fail: Sequence[str], options: Sequence[str]) -> dict[str, list[str]]:
    """Return the words for the run of each robot of a fleet: its scenario, its faults, and its own options; raises RequestError."""
    robots, said = find_robot().robots, dict(scenario.robots)
    for name in said:
        if name not in robots:
            raise RequestError(with_nearest(f"the scenario {scenario.name} names a robot {name}", name, robots))
    if missing := [name for name in robots if name not in said]:
        how = f"add `robots: {{{missing[0]}: standby}}`, or --served"
        raise RequestError(f"the scenario {scenario.name} does not say how {missing[0]} serves its skills; {how}")
    words = {name: [one] for name, one in said.items()}
    for text in fail:
        robot = next((name for name in words if text.startswith(fleet_name(name, ""))), "")
        if not robot:
            raise RequestError(f"--fail {text}: say of which robot, as {fleet_name(next(iter(words)), text)}")
        words[robot].append(f"--fail={text.removeprefix(fleet_name(robot, ''))}")
    for text in options:
        robot, _, option = text.partition(":")
        if robot not in words or not option.startswith("--"):
            raise RequestError(f"--with {text}: needs a robot and an option of its run, as {next(iter(words))}:--rate=0")
        words[robot].append(option)
    return words


def with_claim(request: RunSpec, claim: DomainClaim, part: RunPart) -> RunSpec:
    """Return the run with its domain, and what only a run with its seat takes; raises RequestError, NoFreePortError."""
    run = replace(request, domain=claim.domain, seat=claim.seat)
    return replace(run, own=part.claim(run))


def read_domain(number: int | None) -> int:
    """Return the domain that is asked for, 0 where none is; raises RequestError."""
    if number is not None and number not in DOMAINS:
        raise RequestError(f"--domain {number}: a run has a DDS domain from {DOMAINS[0]} to {DOMAINS[-1]}")
    return number or 0


def read_namespace(name: str) -> str:
    """Return a namespace with its slash, empty where none is asked for; raises RequestError."""
    namespace = f"/{name.strip('/')}" if name else ""
    if namespace and not NAMESPACE.fullmatch(namespace):
        raise RequestError(f"--namespace {name}: write a name such as rover, of letters, digits and _, beginning with a letter")
    return namespace


def read_scenario(name: str) -> Scenario:
    """Read a scenario that can be started; raises RequestError."""
    try:
        scenario = load_scenario(name)
    except ScenarioError as error:
        raise RequestError(str(error)) from None
    launch_file(scenario)
    return scenario


def read_faults(texts: Sequence[str], known: Mapping[str, Sequence[str]] | None) -> tuple[str, ...]:
    """Check what `--fail` asks for, and return it in the form that all parts read."""
    try:
        return tuple(str(parse_fault(text, known)) for text in texts)
    except FaultError as error:
        raise RequestError(f"--fail: {error}") from None
