"""A run that was recorded, as a program has it: its folder, its record, its conformance, its decisions made again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from alula.api.record import Record
from alula.common import run_log
from alula.common.faults import FaultChange
from alula.common.public import public
from alula.common.record import FILE as RECORD
from alula.common.robots import RobotError, RobotFolder, find_robot, load_robot_folder, meaning
from alula.common.runs import LATEST, NoRunError, find_run
from alula.missions.director import EXIT_CODES, Outcome
from alula.records.conformance import ConformanceVerdict, judge
from alula.records.logs import read_log
from alula.records.replay.deciding import Conditions, decide, read_mission
from alula.records.replay.recorded import load
from alula.records.replay.replay import Result
from alula.runtime.live.spec import FILE, RunSpec

SUMMARY = "summary.json"


@public()
class Run:
    """A run that was recorded; `open_run` opens it.

    Attributes:
        folder: where it left its files.
        robot: the robot that it is a run of, None where none is known.
    """

    def __init__(self, folder: Path, robot: RobotFolder | None = None) -> None:
        self.folder = folder
        self.robot = robot

    @cached_property
    def record(self) -> Record:
        """Its record: what the mission decided, and the events and data that it had received."""
        return Record(self.folder)

    @cached_property
    def request(self) -> Mapping[str, Any]:
        """The request of the run: scenario, seed, faults (``run.json``)."""
        return _object(self.folder / FILE)

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """The figures of its report (``summary.json``); raises NoRunError where no report was made."""
        return _object(self.folder / SUMMARY)

    @cached_property
    def mission(self) -> Mapping[str, Any]:
        """The mission's account: outcome, reason, parameters, inputs, and the output ports of its tree."""
        return run_log.account(self.folder, self.record if (self.folder / RECORD).is_file() else ())

    @property
    def outcome(self) -> Outcome:
        """How its mission ended."""
        return Outcome(self.mission.get("outcome", Outcome.RUNNING.value))

    @property
    def faults(self) -> list[FaultChange]:
        """The faults that began and that were mended, in the order of time."""
        return [FaultChange(str(one["sensor"]), str(one["mode"]), float(one["t_s"])) for one in run_log.read(self.folder, run_log.FAULT)]

    def report(self) -> Mapping[str, Any]:
        """Make the report of a run over mocks (``summary.json``, ``report.html``, pictures); return the summary."""
        from alula.report.facts import RunFacts
        from alula.report.making import make_report  # late: it draws

        spec = RunSpec.load(self.folder / FILE)
        with meaning(self.robot):
            make_report(RunFacts(spec.scenario, spec.seed, self.folder, spec.faults, (), EXIT_CODES[self.outcome], mock=True))
        self.__dict__.pop("summary", None)
        return self.summary

    def conform(self, *models: str | Path) -> ConformanceVerdict:
        """Check that the semantics of the models allows each of its events; return the verdict.

        Args:
            models: files of models instead of the robot's.

        Raises:
            AlulaError: the record has no events, or there is no model of a skillset.
        """
        with meaning(self.robot):
            return judge(read_log(self.folder), list(map(Path, models)))

    def replay(
        self,
        *,
        fail: Sequence[str] = (),
        settings: Mapping[str, float] | None = None,
        tree: str | Path = "",
        models: Sequence[str | Path] = (),
        go_on: bool = False,
        out: str | Path | None = None,
    ) -> Result:
        """Make its decisions again, as they were or with one thing changed; return them with the first difference.

        Args:
            fail: what did not fail then, as ``laser@20``.
            settings: other values of the mission's parameters.
            tree: the file of another mission.
            models: files of other models.
            go_on: go on over mocks after the first difference; else the replay stops there.
            out: folder for the replay's own record.

        Raises:
            AlulaError: what was changed does not fit the record.
        """
        with meaning(self.robot):
            recorded = load(self.folder)
            mission = read_mission(recorded, tree=str(tree), models=list(map(Path, models)))
            texts = [f"{name}={value!r}" for name, value in (settings or {}).items()]
            return decide(mission, Conditions(fail=fail, settings=texts, go_on=go_on, out=None if out is None else Path(out)))


@public()
def open_run(folder: str | Path, robot: str | Path | None = None) -> Run:
    """Open the folder of a run, over mocks or live.

    Args:
        folder: the folder, as ``runs/20260101-120000-patrol``; ``latest``: of the live run under way that began last.
        robot: the folder of the robot that it is a run of; None: that of the current folder or above, if there is one.

    Raises:
        NoRunError: it is no folder of a run, or no run is under way.
        RobotError: there is no such robot.
    """
    place = find_run(LATEST).folder if folder == LATEST else Path(folder)
    if not (place / FILE).is_file():
        raise NoRunError(f"{place} is no run's folder: it has no {FILE}")
    return Run(place, _robot() if robot is None else load_robot_folder(Path(robot).resolve()))


def _robot() -> RobotFolder | None:
    try:
        return find_robot()
    except RobotError:
        return None


def _object(path: Path) -> Mapping[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise NoRunError(f"{path}: can't be read: {error}") from error
    if not isinstance(content, dict):
        raise NoRunError(f"{path}: is no JSON object")
    return content
