"""The runs of a robot that are under way, and where their ROS 2 side can be talked to."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

from alula.common.deployments import load_deployment
from alula.common.errors import AlulaError
from alula.common.network import DOMAINS, is_claimed
from alula.common.processes import processes_of_run
from alula.common.robots import FILE as ROBOT_FILE
from alula.common.robots import RobotError, RobotFolder, find_robot, load_robot_folder

LATEST = "latest"


class NoRunError(AlulaError):
    """There is no such run, or it has ended; the message says what to do."""


@dataclass(frozen=True)
class Run:
    """A run's folder, DDS domain and namespace there (``/rover``; empty: none), and the id that its processes carry; empty: not known."""

    folder: Path
    domain: int
    run_id: str = ""
    namespace: str = ""

    @property
    def live(self) -> bool:
        """Return whether the domain is held, and by this run: domains are used again, and what is sent there reaches the run that has it.

        A domain that no run is given by itself, which a deployment may have, can't be held.
        """
        held = is_claimed(self.domain) if self.domain in DOMAINS else bool(self.run_id)
        return held and (not self.run_id or bool(processes_of_run(self.run_id)))


def runs_folder() -> Path:
    """Return the folder that runs are put into when nothing else is asked for: the robot's, or ``runs`` here where there is no robot."""
    try:
        return find_robot().runs
    except RobotError:
        return Path("runs")


def up_folder() -> Path:
    """Return where each deployment of the robot that is up has a folder, with a ``run.json`` as a run has; raises RobotError."""
    return Path(os.environ.get("ALULA_ROBOT_STATE") or find_robot().root / ".alula") / "up"


def is_deployment(folder: Path) -> bool:
    """Return whether a folder that is shown as a run is that of a deployment."""
    try:
        return folder.parent == up_folder()
    except RobotError:
        return False


def deployments_up() -> list[Run]:
    """Return the robot's deployments that are up on this computer; none where there is no robot."""
    try:
        return live_runs(up_folder())
    except RobotError:
        return []


def find_deployment(name: str) -> Run:
    """Return a deployment that is up, as a run is; raises DeploymentError where there is none of that name, NoRunError where it is down."""
    load_deployment(name)
    found = next((run for run in deployments_up() if run.folder.name == name), None)
    if found is None:
        raise NoRunError(f"{name} is not up on this computer: alula up {name}")
    return found


def robot_of(log: Path) -> RobotFolder | None:
    """Return the robot that a run or a log is of: the one that ``run.json`` names, else that of a folder above it.

    None: neither is there, or its file is wrong. The current folder and the robot that is meant do not matter.
    """
    place = log.resolve()
    folder = place if place.is_dir() else place.parent
    named = (Path(text) for text in [_robot_named(folder)] if text)
    found = next((one for one in (*named, *(folder, *folder.parents)) if (one / ROBOT_FILE).is_file()), None)
    try:
        return None if found is None else load_robot_folder(found)
    except RobotError:
        return None


def _robot_named(folder: Path) -> str:
    try:
        return str(json.loads((folder / "run.json").read_text(encoding="utf-8")).get("robot", ""))
    except (OSError, ValueError, AttributeError, RecursionError):
        return ""


def load_run(folder: Path) -> Run:
    """Read a run's folder; raise NoRunError."""
    try:
        known = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        return Run(folder, int(known["domain"]), str(known.get("run_id", "")), str(known.get("namespace", "")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise NoRunError(f"{folder} is no run's folder: it has no run.json that names a domain") from error


def live_runs(folder: Path | None = None) -> list[Run]:
    """Return the runs under way, the newest first."""
    found: list[tuple[float, Run]] = []
    for path in (runs_folder() if folder is None else folder).glob("*/run.json"):
        try:
            found.append((path.stat().st_mtime, load_run(path.parent)))
        except (OSError, NoRunError):
            continue
    # Domains are used again: the last run that was given one, in its namespace, is the one that holds it.
    newest: dict[tuple[int, str], Run] = {}
    for _, run in sorted(found, key=lambda pair: pair[0], reverse=True):
        newest.setdefault((run.domain, run.namespace), run)
    return [run for run in newest.values() if run.live]


def find_run(which: str) -> Run:
    """Return the run of a folder, or the ``latest`` one that is under way.

    Raises:
        NoRunError: there is none, or it has ended.
    """
    if which == LATEST:
        runs = live_runs()
        if not runs:
            raise NoRunError(f"no run is under way in {runs_folder()}; start one (alula run SCENARIO), or name its folder (--run DIR)")
        return runs[0]
    run = load_run(Path(which))
    if not run.live:
        raise NoRunError(f"the run in {which} has ended: it does not hold its domain {run.domain} any more")
    return run
