"""The problems of a mission as findings, with the line that each is about, as those of models are."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from alula.check.mission import check_mission
from alula.language.errors import Diagnostic, Severity
from alula.language.messages import NO_MESSAGES, Messages
from alula.language.models import ModelFile
from alula.missions.mission_file import MissionFile
from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset
from alula.model.span import Span
from alula.trees.errors import FileError, Place, Problem
from alula.trees.library import Library
from alula.trees.reading import read_models
from alula.trees.source import TreeSource

_WORD = re.compile(r"""<?[^\s=<>"'/]+""")
"""What a place without a length stands for: a tag, an attribute's name, a value."""


def findings_of(
    path: str,
    text: bytes,
    skillsets: Sequence[Skillset],
    palettes: Sequence[Path] = (),
    part: MissionPart = NO_PART,
    messages: Messages = NO_MESSAGES,
    library: Library | None = None,
    *,
    of_others: bool = False,
    enums: Mapping[str, float] | None = None,
) -> list[Diagnostic]:
    """Return what is wrong with a mission whose file has a text, or will have it; as `read_and_check`."""
    source = TreeSource(Path(path), library or Library(), enums=enums or {})
    return read_and_check(source, text, skillsets, palettes, part, messages, of_others=of_others)[1]


def read_and_check(
    source: TreeSource,
    text: bytes,
    skillsets: Sequence[Skillset],
    palettes: Sequence[Path] = (),
    part: MissionPart = NO_PART,
    messages: Messages = NO_MESSAGES,
    *,
    of_others: bool = False,
    checked: Library | None = None,
) -> tuple[MissionFile | None, list[Diagnostic]]:
    """Return a mission, None where it can't be read, and what `check_mission` finds wrong with it.

    Where it can't be read or put together, the reason is the only finding (ALU0..). ``palettes`` are files that declare more types of node.
    """
    problems: list[Problem] = []
    mission = None
    try:
        source = replace(source, types=[one for palette in palettes for one in read_models(palette)])
        mission = MissionFile.read(source, skillsets, part, problems.append, whole=not of_others, text=text)
        problems = check_mission(mission, problems, messages, foreign=bool(palettes), of_others=of_others, checked=checked)
    except FileError as error:
        problem = error.problem
        code = problem.code if problem.code.startswith("ALU0") else "ALU004"
        problems = [replace(problem, code=code)]
    file = ModelFile(str(source.path), text.decode("utf-8", "replace"))
    return mission, [_finding(problem, file) for problem in problems]


def _finding(problem: Problem, file: ModelFile) -> Diagnostic:
    place = problem.place
    line = file.line(place.line).removesuffix("\r") if place.path == file.path else _line_of(place)
    word = _WORD.match(line, place.column - 1) if problem.length == 1 else None
    span = Span(place.path, place.line, place.column, place.column + (len(word.group()) if word else problem.length))
    severity = Severity.WARNING if problem.warning else Severity.ERROR
    return Diagnostic(problem.code, problem.message, span, severity, problem.cure, source_line=line)


def _line_of(place: Place) -> str:
    """Return a line of an included file."""
    try:
        lines = Path(place.path).read_bytes().decode("utf-8", "replace").split("\n")
    except OSError:
        return ""
    return lines[place.line - 1].removesuffix("\r") if place.line <= len(lines) else ""
