"""Checks models and missions, and proves what can be proved: what `alula check` and `alula.check_files` do.

1. Models are read together, and checked. 2. Missions are checked with the robot's models and nodes. 3. What is free of errors is proved:
all runs of each skillset, all runs of each mission.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, BinaryIO

from alula.common.public import public
from alula.common.robots import RobotError, RobotFolder, find_robot, load_robot_folder, meaning
from alula.common.scenarios import Scenario, ScenarioError
from alula.language import models
from alula.language.check.fields import check_fields
from alula.language.errors import Diagnostic, Severity, has_errors
from alula.language.messages import NO_MESSAGES, Messages, messages_of
from alula.language.models import ModelFile, models_in
from alula.language.side_files import load_types
from alula.model.model import Skillset
from alula.model.span import Span
from alula.trees.document import read_source
from alula.trees.errors import FileError
from alula.trees.library import ENDINGS, Library
from alula.trees.node import name_in_files
from alula.trees.source import TreeSource

if TYPE_CHECKING:
    from alula.missions.mission_file import MissionFile
    from alula.missions.part import MissionPart

OnProgress = Callable[[str], None]
"""Takes a line about progress, or about what is left out."""
NO_ENUMS: Mapping[str, float] = {}
TIME_S = 30.0
"""What the proofs of a file may take."""


def ignore(_line: str) -> None:
    """Take no notice."""


@public()
def check_files(
    *paths: str | Path,
    robot: str | Path | None = None,
    palettes: Sequence[str | Path] = (),
    main: str = "",
    packages: Mapping[str, str | Path] | None = None,
    enums: Mapping[str, float] | None = None,
    proofs: bool = True,
    closed_world: bool = False,
    timeout_s: float = TIME_S,
    on_progress: Callable[[str], None] = ignore,
    tell: Callable[[str], None] | None = None,
) -> list[Diagnostic]:
    """Check models and missions, and prove their properties; return all findings, file by file.

    A finding is an error, a warning or a note (`Severity`); without one that is an error the files can be used. A property that fails has
    a ``counterexample``.

    Args:
        paths: models (``*.skill``, ``*.rl``), missions (``*.xml``, ``*.btproj``), folders of both, whose trees may use one another; none:
            the robot's models.
        robot: its folder, whose models and nodes the missions are made of; None: that of the current folder or above.
        palettes: of missions, files of more types of nodes (TreeNodesModel).
        main: the ID of the main tree, where a mission does not say it.
        packages: folders of ROS packages, by their names, for includes that name one.
        enums: numbers of names that scripts of missions may use.
        proofs: False: leave out the proofs.
        closed_world: assume that transitions that are neither extern nor used by an effect are never taken.
        timeout_s: for the proofs of a file; what could not be decided in it is a finding.
        on_progress: takes lines about the progress.
        tell: deprecated name of ``on_progress``.

    Raises:
        AlulaError: no files are given, and there is no robot.
    """
    if tell is not None:
        warnings.warn(
            "check_files(tell=...) is check_files(on_progress=...) now; the old name goes with the next minor version",
            DeprecationWarning,
            stacklevel=2,
        )
        on_progress = tell
    with meaning(None if robot is None else load_robot_folder(Path(robot).resolve())):
        given = list(map(str, paths)) or robot_models(find_robot())
        others = {name: Path(folder) for name, folder in (packages or {}).items()}
        files = checked_files(
            given, palettes=list(map(str, palettes)), main=main, packages=others, enums=enums or {}, on_progress=on_progress
        )
        if proofs:
            prove_files(files, timeout_s, closed_world=closed_world, on_progress=on_progress)
    return [finding for file in files for finding in file.findings]


def robot_models(robot: RobotFolder) -> list[str]:
    """Return the folder of a robot's models, or those of a fleet's robots."""
    return [str(one.skillsets) for one in robot.robots.values()] or [str(robot.skillsets)]


def is_mission(path: str) -> bool:
    """Return whether a file is a mission, by its name."""
    return path.endswith(ENDINGS)


def checked_files(
    places: Sequence[str],
    standard_input: BinaryIO | None = None,
    *,
    palettes: Sequence[str] = (),
    main: str = "",
    packages: Mapping[str, Path] | None = None,
    enums: Mapping[str, float] = NO_ENUMS,
    on_progress: OnProgress = ignore,
) -> list[ModelFile]:
    """Return the models, then the missions, with their findings; `-` is the standard input where that is given."""
    library = Library(packages)
    missions: dict[str, None] = {}
    paths: dict[str, None] = {}
    for place in dict.fromkeys(places):
        trees = [str(path) for path in library.files(Path(place))] if is_mission(place) or Path(place).is_dir() else []
        missions |= dict.fromkeys(trees)
        if not is_mission(place):
            found = models_in(place)
            paths |= dict.fromkeys(found if found != [place] or not trees else ())
    read = models.check_files(list(paths), standard_input)
    for model in read:
        check_fields(model)
    for folder, first in {Path(one.path).parent: one for one in reversed(read) if Path(one.path).is_file()}.items():
        first.findings += load_types(folder / "types.yaml")[1]  # once for all models beside it
    checked = _checked_missions(list(missions), list(map(Path, palettes)), library, main, enums, on_progress)
    for file in checked:
        file.named = file.path in {str(Path(place)) for place in places}
    return [*read, *checked]


def prove_files(files: Sequence[ModelFile], timeout_s: float, *, closed_world: bool = False, on_progress: OnProgress = ignore) -> None:
    """Add what the proofs find about each file that is free of errors."""
    prove_models(
        [file for file in files if not isinstance(file, CheckedMission)], timeout_s, closed_world=closed_world, on_progress=on_progress
    )
    prove_missions([file for file in files if isinstance(file, CheckedMission)], timeout_s, on_progress)


# --- models -------------------------------------------------------------------------------------------------------------


def prove_models(files: Sequence[ModelFile], timeout_s: float, *, closed_world: bool, on_progress: OnProgress = ignore) -> None:
    """Add the prover's findings about every skillset of a file that is free of errors."""
    # The prover brings its solvers along, which a conversion should not wait for.
    from alula.prove.skillset.prover import prove

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
            report = partial(_proof_progress, on_progress, f"{file.path}: {skillset.name}")
            found += prove(skillset, closed_world=closed_world, timeout_s=left_s, on_progress=report)
        file.add(found)


def counterexamples_of(
    files: Sequence[ModelFile], timeout_s: float, *, closed_world: bool, on_progress: OnProgress = ignore
) -> list[tuple[Skillset, Diagnostic]]:
    """Prove the files; return each finding that has a counterexample with steps, in the order of the output, with its skillset."""
    prove_models(files, timeout_s, closed_world=closed_world, on_progress=on_progress)
    return [
        (max((one for one in file.skillsets if one.span.line <= finding.span.line), key=lambda one: one.span.line), finding)
        for file in files
        for finding in file.findings
        if finding.counterexample.steps
    ]


def _proof_progress(on_progress: OnProgress, what: str, progress: str) -> None:
    on_progress(f"{what}: proving: {progress}")


def _not_begun(skillsets: Sequence[Skillset], timeout_s: float) -> Diagnostic:
    """Return the prover's own finding for a lack of time, for skillsets that it was not even asked about."""
    severity = Severity.ERROR if any(skillset.properties for skillset in skillsets) else Severity.WARNING
    message = f"no proof was tried for this skillset and {len(skillsets) - 1} more: the {timeout_s:g} s for the file are over"
    return Diagnostic("ALU540", message, skillsets[0].span, severity, "allow more with `--time`, or divide the file")


# --- missions -----------------------------------------------------------------------------------------------------------


@dataclass
class CheckedMission(ModelFile):
    """A mission with its findings.

    Attributes:
        source: where it is read from.
        named: it was asked for itself, and not found in a folder.
        mission: what was read, for whoever proves or plays it; None where it can't be read.
        own: it is a mission of the robot around, and no tree of another program.
    """

    source: TreeSource = field(kw_only=True)
    named: bool = field(kw_only=True)
    mission: MissionFile | None = None
    own: bool = False


def _checked_missions(
    paths: Sequence[str], palettes: Sequence[Path], library: Library, main: str, enums: Mapping[str, float], on_progress: OnProgress
) -> list[CheckedMission]:
    """Return each mission with its findings; what can't be read is told, too, in one line.

    Several are a library for one another; ``main`` is the main tree of the one that has it.
    """
    if not paths:
        return []
    robot = _robot(on_progress)
    if len(paths) > 1:
        library.add(map(Path, paths))
    files: dict[Path, CheckedMission] = {}
    for path in map(Path, paths):
        mine = main if path.resolve() in {Path(one.place.path).resolve() for one in library.trees.get(main, ())} or len(paths) == 1 else ""
        source = TreeSource(path, robot.library(path, library), mine, enums)
        files[path.resolve()] = CheckedMission(str(path), source=source, named=True)
    beside = library if len(paths) > 1 else None
    for file in files.values():
        for finding in _checked(file, robot, palettes, beside, on_progress):
            its = files.get(Path(finding.span.file).resolve(), file)  # one file's tree is checked in another, too, that uses it
            if finding not in its.findings:
                its.findings.append(finding)
    for file in files.values():
        file.findings.sort(key=lambda one: (one.span.file != file.path, one.span.file, one.span.line, one.span.column))
    return list(files.values())


def prove_missions(files: Sequence[CheckedMission], timeout_s: float, on_progress: OnProgress = ignore) -> None:
    """Look at all runs of the missions that are free of errors and use skills, and add what is found."""
    sound = [file for file in files if not has_errors(file.findings)]
    if not sound:
        return
    # Late: the search brings its solvers along, and models are checked without it.
    from alula.prove.mission.prover import prove_mission
    from alula.records.causes.fault_file import states_of_faults

    faults: Mapping[str, frozenset[str]] = {}
    for file in sound:
        mission = file.mission
        if mission is None or mission.files.is_part or not (mission.skillsets if file.own else _is_known(file, mission)):
            continue  # what can't be looked at, or a part of other missions, which are looked at
        faults = faults or (states_of_faults(mission.skillsets, on_progress) if mission.skillsets else {})
        proved = prove_mission(mission, faults=faults, timeout_s=timeout_s, on_progress=partial(_runs_progress, on_progress, file.path))
        file.findings += [*proved.findings, *map(_accepted, proved.accepted)]


_UNKNOWN = frozenset({"ALU601", "ALU607"})
"""What a tree of another program lacks: nodes that nobody declares, entries that the program writes."""


def _is_known(file: CheckedMission, mission: MissionFile) -> bool:
    """Return whether the runs of a tree of another program are looked at: it is named, has a main tree, and lacks no node and no entry."""
    return file.named and bool(mission.files.main) and not any(one.code in _UNKNOWN for one in file.findings)


def _accepted(finding: Diagnostic) -> Diagnostic:
    """Return a finding that the file accepts, as a note: it is no defect, but can be looked at and played."""
    return replace(finding, severity=Severity.NOTE, message=f"accepted in the file: {finding.message}", hint="")


def _runs_progress(on_progress: OnProgress, path: str, progress: str) -> None:
    on_progress(f"{path}: looking at its runs: {progress}")


@dataclass(frozen=True)
class _Robot:
    """What missions are checked with; ``root`` is None where there is no robot: a tree of others has its palette."""

    root: Path | None = None
    skillsets: tuple[Skillset, ...] = ()
    part: MissionPart | None = None
    messages: Messages = NO_MESSAGES
    scenarios: Mapping[Path, Scenario] = field(default_factory=dict)
    """By the files of their missions."""

    def library(self, path: Path, library: Library) -> Library:
        """Return the library of a mission: that of the command line, with that of the scenario that flies it."""
        scenario = self.scenarios.get(path.resolve())
        return library if scenario is None or not scenario.library else library.extended(scenario.library)

    def has(self, path: Path, source: bytes) -> bool:
        """Return whether a file is a mission of this robot: it lies in its folder, or names a skillset or a node of it."""
        if self.root is None or self.root in path.resolve().parents:
            return self.root is not None
        names = [f"{one.name}." for one in self.skillsets] + [f"<{name_in_files(node)}" for node in (self.part.nodes if self.part else ())]
        return any(re.search(rb"\b" * name[0].isalpha() + re.escape(name.encode()) + rb"\b", source) for name in names)


def _robot(on_progress: OnProgress) -> _Robot:
    try:
        robot = find_robot()
    except RobotError as error:
        on_progress(f"no skills are known: {error}")
        return _Robot()
    from alula.check.robot import models_of, part_of  # late, as in `_checked`

    return _Robot(robot.root, models_of(robot, on_progress), part_of(robot, on_progress), messages_of(robot), _flown(on_progress))


def _flown(on_progress: OnProgress) -> dict[Path, Scenario]:
    from alula.missions.scenario import by_mission  # late, as in `_checked`

    try:
        return by_mission()
    except ScenarioError as error:
        on_progress(str(error))
        return {}


def _checked(
    file: CheckedMission, robot: _Robot, palettes: Sequence[Path], beside: Library | None, on_progress: OnProgress
) -> list[Diagnostic]:
    """Read a mission, and return what is wrong with it."""
    from alula.check.findings import read_and_check  # late: models are checked without it
    from alula.missions.part import NO_PART

    try:
        text = read_source(file.source.path)
        file.own = robot.has(file.source.path, text)
        own = robot if file.own else _Robot()
        known = (own.skillsets, palettes, own.part or NO_PART, own.messages)
        mission, found = read_and_check(file.source, text, *known, of_others=not file.own, checked=beside)
        file.mission = mission and mission.declaring()
    except FileError as error:
        found = [Diagnostic("ALU001", error.problem.message, Span(file.path, 0, 0, 0))]
    for finding in found:
        if finding.code.startswith("ALU0") and finding.severity is Severity.ERROR:
            cure = f"; {finding.hint}" if finding.hint else ""
            on_progress(f"{finding.span if finding.span.line else file.path}: {finding.message}{cure}")
    return found
