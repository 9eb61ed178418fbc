"""The command line of ``alula run``: what live runs and runs over mocks have in common."""

from __future__ import annotations

import argparse
import math
from datetime import datetime, timezone
from pathlib import Path

from alula.common.robots import find_robot, wrong_world
from alula.common.runs import runs_folder
from alula.common.scenarios import Scenario, scenario_names
from alula.runtime.live.spec import RequestError
from alula.trees.groot.address import Address, ServerError

FAULT = "WHAT[:HOW][@SECONDS[-SECONDS]]"
MAX_SEED = 2**31 - 1


def run_parser(about: str) -> argparse.ArgumentParser:
    """Return a parser with the options of every run."""
    parser = argparse.ArgumentParser(prog="alula run", description=about)
    parser.add_argument("scenario", help=f"name of the scenario: {', '.join(scenario_names())}")
    parser.add_argument("--fail", action="append", default=[], metavar=FAULT, help="a fault, seconds after the departure; repeatable")
    parser.add_argument("--world", default="", metavar="FILE|NAME", help="surroundings and inputs of the mission (default: the scenario's)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random choices (default 0)")
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/TIME-SCENARIO of the robot)")
    parser.add_argument("--monitor", action="store_true", help="check every event against the models")
    parser.add_argument("--groot", nargs="?", const="", metavar="[HOST:]PORT", help="show the tree to Groot2 and its like (127.0.0.1:1667)")
    parser.add_argument("--limit", type=float, default=0.0, metavar="SECONDS", help="end the run after so long, by the mission clock")
    parser.add_argument("--mock", action="store_true", help="run over mocks in virtual time: without simulator and ROS, in about a second")
    return parser


def check_seed(seed: int) -> int:
    """Return a seed that launch files can carry; raises RequestError."""
    if not 0 <= seed <= MAX_SEED:
        raise RequestError(f"--seed {seed}: must lie between 0 and {MAX_SEED}")
    return seed


def check_limit(seconds: float) -> float:
    """Return how long the run may last, 0: without a limit; raises RequestError."""
    if not 0.0 <= seconds < math.inf:  # also refuses nan
        raise RequestError(f"--limit {seconds:g}: must be 0 (no limit) or a number of seconds")
    return seconds


def world_file(scenario: Scenario, wanted: str) -> str:
    """Return the file of the world that is wanted, or the scenario's; empty where it has none. Raises RequestError."""
    name = wanted or scenario.world
    if not name:
        return ""
    robot = find_robot()
    path = robot.world(name)
    if not path.is_file():
        raise RequestError(f"--world: {wrong_world(robot, name)}")
    return str(path.absolute())


def groot_address(wanted: str | None) -> str:
    """Return where viewers find the mission's tree, as HOST:PORT; empty where none are wanted. Raises RequestError."""
    if wanted is None:
        return ""
    try:
        address = Address.read(wanted).looked_up()
    except ServerError as error:
        raise RequestError(f"--groot: {error}") from None
    return str(address)


def shown_at(groot: str) -> str:
    """Say where viewers find the tree."""
    return f"Groot2 and its like find the tree at {groot}"


def run_folder(wanted: Path | None, scenario: str) -> Path:
    """Return an absolute path that holds no run yet; raises RequestError where the wanted one does."""
    if wanted is not None:
        folder = wanted.expanduser().absolute()
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise RequestError(f"--out {wanted}: exists and is not an empty folder; choose another, a run never overwrites")
        return folder
    base = runs_folder().absolute() / f"{datetime.now(tz=timezone.utc).astimezone():%Y%m%d-%H%M%S}-{scenario}"
    candidates = (base, *(base.with_name(f"{base.name}-{n}") for n in range(2, 1000)))
    return next(folder for folder in candidates if not folder.exists())
