"""What a run is asked for, checked before anything starts: of live runs and of runs over mocks."""

from __future__ import annotations

import math
from datetime import datetime, timezone
from pathlib import Path

from alula.common.robots import find_robot, wrong_world
from alula.common.runs import runs_folder
from alula.common.scenarios import Scenario
from alula.runtime.live.spec import RequestError
from alula.trees.groot.address import Address, ServerError

MAX_SEED = 2**31 - 1


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
    return f"Groot2 and other viewers find the tree at {groot}"


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
