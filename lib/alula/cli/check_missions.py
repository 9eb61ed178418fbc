"""The part of `alula check` that reads missions: which models and palettes go with a file."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from alula.check.findings import findings_of
from alula.check.robot import models_of, part_of
from alula.cli.saying import warner
from alula.common.robots import RobotError, find_robot
from alula.language.errors import Diagnostic, Severity, has_errors
from alula.language.messages import NO_MESSAGES, Messages, messages_of
from alula.language.models import ModelFile
from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset
from alula.model.span import Span
from alula.records.causes.fault_file import states_of_faults
from alula.trees.document import read_source
from alula.trees.errors import FileError

SUFFIX = ".xml"
COMMAND = "alula check"
warn = warner(COMMAND)


def check_missions(paths: Sequence[str], palettes: Sequence[str]) -> list[ModelFile]:
    """Return each mission with its findings; what can't be read is told on standard error, too, in one line."""
    if not paths:
        return []
    skillsets, part, messages = _robot()
    return [_checked(path, skillsets, [Path(palette) for palette in palettes], part, messages) for path in paths]


def prove_missions(files: Sequence[ModelFile], timeout_s: float) -> None:
    """Look at all runs of the missions that are free of errors and use skills, and add what is found."""
    sound = [file for file in files if not has_errors(file.findings)]
    if not sound:
        return
    from alula.prove.mission.prover import prove_mission  # which brings its solvers along

    skillsets, part, _ = _robot()
    faults = states_of_faults(skillsets, warn) if skillsets else {}
    for file in sound if skillsets else []:
        tell = partial(_tell, file.path)
        proved = prove_mission(Path(file.path), skillsets, part, faults=faults, timeout_s=timeout_s, tell=tell)
        file.findings += [*proved.findings, *map(_accepted, proved.accepted)]


def _accepted(finding: Diagnostic) -> Diagnostic:
    """Return a finding that the file accepts, as a note: it is no defect, but can be looked at and played."""
    return replace(finding, severity=Severity.NOTE, message=f"accepted in the file: {finding.message}", hint="")


def _tell(path: str, progress: str) -> None:
    sys.stderr.write(f"{COMMAND}: {path}: looking at its runs: {progress}\n")


def _robot() -> tuple[tuple[Skillset, ...], MissionPart, Messages]:
    """Return what is known of the robot, nothing where there is none: a foreign tree has its palette."""
    try:
        robot = find_robot()
    except RobotError as error:
        sys.stderr.write(f"{COMMAND}: no skills are known: {error}\n")
        return (), NO_PART, NO_MESSAGES
    return models_of(robot, warn), part_of(robot, warn), messages_of(robot)


def _checked(path: str, skillsets: Sequence[Skillset], palettes: Sequence[Path], part: MissionPart, messages: Messages) -> ModelFile:
    file = ModelFile(path)
    try:
        file.findings = findings_of(path, read_source(Path(path)), skillsets, palettes, part, messages)
    except FileError as error:
        file.findings = [Diagnostic("ALU001", error.problem.message, Span(path, 0, 0, 0))]
    for finding in file.findings:
        if finding.code.startswith("ALU0") and finding.severity is Severity.ERROR:
            cure = f"; {finding.hint}" if finding.hint else ""
            sys.stderr.write(f"{COMMAND}: {finding.span if finding.span.line else path}: {finding.message}{cure}\n")
    return file
