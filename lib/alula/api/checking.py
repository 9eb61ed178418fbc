"""Checks models and missions, and proves what can be proved: what `alula check` and `alula.check_files` do.

1. Models are read together, and checked. 2. Missions are checked with the robot's models and nodes. 3. What is free of errors is proved:
all runs of each skillset, all runs of each mission.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import BinaryIO

from alula.check.findings import findings_of
from alula.check.robot import models_of, part_of
from alula.common.public import public
from alula.common.robots import RobotError, RobotFolder, find_robot, load_robot_folder, meaning
from alula.language import models
from alula.language.check.fields import check_fields
from alula.language.errors import Diagnostic, Severity, has_errors
from alula.language.messages import NO_MESSAGES, Messages, messages_of
from alula.language.models import ModelFile, models_in
from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset
from alula.model.span import Span
from alula.records.causes.fault_file import states_of_faults
from alula.trees.document import read_source
from alula.trees.errors import FileError
from alula.trees.reading import PROJECT

Tell = Callable[[str], None]
"""Takes a line about progress, or about what is left out."""
MISSIONS = (".xml", PROJECT)
"""How the name of a mission's file ends."""
TIME_S = 30.0
"""What the proofs of a file may take."""


def ignore(_line: str) -> None:
    """Take no notice."""


@public()
def check_files(
    *paths: str | Path,
    robot: str | Path | None = None,
    palettes: Sequence[str | Path] = (),
    proofs: bool = True,
    closed_world: bool = False,
    timeout_s: float = TIME_S,
    tell: Callable[[str], None] = ignore,
) -> list[Diagnostic]:
    """Check models and missions, and prove their properties; return all findings, file by file.

    A finding is an error, a warning or a note (`Severity`); without one that is an error the files can be used. A property that fails has
    a ``counterexample``.

    Args:
        paths: models (``*.skill``, ``*.rl``), folders of them, missions (``*.xml``, ``*.btproj``); none: the robot's models.
        robot: its folder, whose models and nodes the missions are made of; None: that of the current folder or above.
        palettes: of missions, files of more types of nodes (TreeNodesModel).
        proofs: False: leave out the proofs.
        closed_world: assume that transitions that are neither extern nor used by an effect are never taken.
        timeout_s: for the proofs of a file; what could not be decided in it is a finding.
        tell: takes lines about the progress.

    Raises:
        AlulaError: no files are given, and there is no robot.
    """
    with meaning(None if robot is None else load_robot_folder(Path(robot).resolve())):
        files = checked_files(list(map(str, paths)) or robot_models(find_robot()), palettes=list(map(str, palettes)), tell=tell)
        if proofs:
            prove_files(files, timeout_s, closed_world=closed_world, tell=tell)
    return [finding for file in files for finding in file.findings]


def robot_models(robot: RobotFolder) -> list[str]:
    """Return the folder of a robot's models, or those of a fleet's robots."""
    return [str(one.skillsets) for one in robot.robots.values()] or [str(robot.skillsets)]


def is_mission(path: str) -> bool:
    """Tell whether a file is a mission, by its name."""
    return path.endswith(MISSIONS)


def checked_files(
    places: Sequence[str], standard_input: BinaryIO | None = None, *, palettes: Sequence[str] = (), tell: Tell = ignore
) -> list[ModelFile]:
    """Return the models, then the missions, with their findings; `-` is the standard input where that is given."""
    paths = dict.fromkeys(path for place in dict.fromkeys(places) if not is_mission(place) for path in models_in(place))
    read = models.check_files(list(paths), standard_input)
    for model in read:
        check_fields(model)
    return [*read, *checked_missions([place for place in dict.fromkeys(places) if is_mission(place)], palettes, tell)]


def prove_files(files: Sequence[ModelFile], timeout_s: float, *, closed_world: bool = False, tell: Tell = ignore) -> None:
    """Add what the proofs find about each file that is free of errors."""
    prove_models([file for file in files if not is_mission(file.path)], timeout_s, closed_world=closed_world, tell=tell)
    prove_missions([file for file in files if is_mission(file.path)], timeout_s, tell)


# --- models -------------------------------------------------------------------------------------------------------------


def prove_models(files: Sequence[ModelFile], timeout_s: float, *, closed_world: bool, tell: Tell = ignore) -> None:
    """Add the prover's findings about every skillset of a file that is free of errors."""
    # The prover brings its solvers along, which a conversion should not wait for.
    from alula.prove import prove

    for file in files:
        if has_errors(file.findings) or file.damaged:
            continue
        found: list[Diagnostic] = []
        end = monotonic() + timeout_s
        for number, skillset in enumerate(file.skillsets):
            if number and monotonic() >= end:
                found.append(_not_begun(file.skillsets[number:], timeout_s))
                break
            left_s = max(0.0, end - monotonic())
            report = partial(_tell_proof, tell, f"{file.path}: {skillset.name}")
            found += prove(skillset, closed_world=closed_world, timeout_s=left_s, tell=report)
        file.add(found)


def counterexamples_of(
    files: Sequence[ModelFile], timeout_s: float, *, closed_world: bool, tell: Tell = ignore
) -> list[tuple[Skillset, Diagnostic]]:
    """Prove the files; return each finding that has a counterexample with steps, in the order of the output, with its skillset."""
    prove_models(files, timeout_s, closed_world=closed_world, tell=tell)
    return [
        (max((one for one in file.skillsets if one.span.line <= finding.span.line), key=lambda one: one.span.line), finding)
        for file in files
        for finding in file.findings
        if finding.counterexample.steps
    ]


def _tell_proof(tell: Tell, what: str, progress: str) -> None:
    tell(f"{what}: proving: {progress}")


def _not_begun(skillsets: Sequence[Skillset], timeout_s: float) -> Diagnostic:
    """Return the prover's own finding for a lack of time, for skillsets that it was not even asked about."""
    severity = Severity.ERROR if any(skillset.properties for skillset in skillsets) else Severity.WARNING
    message = f"no proof was tried for this skillset and {len(skillsets) - 1} more: the {timeout_s:g} s for the file are over"
    return Diagnostic("ALU540", message, skillsets[0].span, severity, "allow more with `--time`, or divide the file")


# --- missions -----------------------------------------------------------------------------------------------------------


def checked_missions(paths: Sequence[str], palettes: Sequence[str] = (), tell: Tell = ignore) -> list[ModelFile]:
    """Return each mission with its findings; what can't be read is told, too, in one line."""
    if not paths:
        return []
    skillsets, part, messages = _robot(tell)
    return [_checked(path, skillsets, [Path(palette) for palette in palettes], part, messages, tell) for path in paths]


def prove_missions(files: Sequence[ModelFile], timeout_s: float, tell: Tell = ignore) -> None:
    """Look at all runs of the missions that are free of errors and use skills, and add what is found."""
    sound = [file for file in files if not has_errors(file.findings)]
    if not sound:
        return
    from alula.prove.mission.prover import prove_mission  # which brings its solvers along

    skillsets, part, _ = _robot(ignore)  # what is to be told of it was told when they were checked
    faults = states_of_faults(skillsets, tell) if skillsets else {}
    for file in sound if skillsets else []:
        report = partial(_tell_runs, tell, file.path)
        proved = prove_mission(Path(file.path), skillsets, part, faults=faults, timeout_s=timeout_s, tell=report)
        file.findings += [*proved.findings, *map(_accepted, proved.accepted)]


def _accepted(finding: Diagnostic) -> Diagnostic:
    """Return a finding that the file accepts, as a note: it is no defect, but can be looked at and played."""
    return replace(finding, severity=Severity.NOTE, message=f"accepted in the file: {finding.message}", hint="")


def _tell_runs(tell: Tell, path: str, progress: str) -> None:
    tell(f"{path}: looking at its runs: {progress}")


def _robot(tell: Tell) -> tuple[tuple[Skillset, ...], MissionPart, Messages]:
    """Return what is known of the robot, nothing where there is none: a foreign tree has its palette."""
    try:
        robot = find_robot()
    except RobotError as error:
        tell(f"no skills are known: {error}")
        return (), NO_PART, NO_MESSAGES
    return models_of(robot, tell), part_of(robot, tell), messages_of(robot)


def _checked(
    path: str, skillsets: Sequence[Skillset], palettes: Sequence[Path], part: MissionPart, messages: Messages, tell: Tell
) -> ModelFile:
    file = ModelFile(path)
    try:
        file.findings = findings_of(path, read_source(Path(path)), skillsets, palettes, part, messages)
    except FileError as error:
        file.findings = [Diagnostic("ALU001", error.problem.message, Span(path, 0, 0, 0))]
    for finding in file.findings:
        if finding.code.startswith("ALU0") and finding.severity is Severity.ERROR:
            cure = f"; {finding.hint}" if finding.hint else ""
            tell(f"{finding.span if finding.span.line else path}: {finding.message}{cure}")
    return file
