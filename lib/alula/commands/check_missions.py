"""The part of `alula check` that reads missions: which models and palettes go with a file."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from alula.common.robots import RobotError, find_robot
from alula.language.errors import Diagnostic, Severity, has_errors
from alula.language.models import ModelFile, check_files, models_in
from alula.missions.check.findings import findings_of
from alula.model.model import Skillset
from alula.model.span import Span
from alula.trees.document import read_source
from alula.trees.errors import FileError

SUFFIX = ".xml"


def check_missions(paths: Sequence[str], palettes: Sequence[str]) -> list[ModelFile]:
    """Return each mission with its findings; what can't be read is told on standard error, too, in one line."""
    skillsets = _skillsets() if paths else ()
    return [_checked(path, skillsets, [Path(palette) for palette in palettes]) for path in paths]


def _skillsets() -> tuple[Skillset, ...]:
    """Return the models of the robot, none where there is no robot: a foreign tree has its palette."""
    try:
        folder = find_robot().skillsets
    except RobotError as error:
        sys.stderr.write(f"alula check: no skills are known: {error}\n")
        return ()
    files = check_files(models_in(str(folder)))
    for file in files:
        if has_errors(file.findings):
            sys.stderr.write(f"alula check: {file.path} has errors; `alula check {file.path}` shows them\n")
    return tuple(skillset for file in files for skillset in file.skillsets)


def _checked(path: str, skillsets: Sequence[Skillset], palettes: Sequence[Path]) -> ModelFile:
    file = ModelFile(path)
    try:
        file.findings = findings_of(path, read_source(Path(path)), skillsets, palettes)
    except FileError as error:
        file.findings = [Diagnostic("ALU001", error.problem.message, Span(path, 0, 0, 0))]
    for finding in file.findings:
        if finding.code.startswith("ALU0") and finding.severity is Severity.ERROR:
            cure = f"; {finding.hint}" if finding.hint else ""
            sys.stderr.write(f"alula check: {finding.span if finding.span.line else path}: {finding.message}{cure}\n")
    return file
