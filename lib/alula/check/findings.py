"""The problems of a mission as findings, with the line that each is about, as those of models are."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from alula.check.mission import check_mission
from alula.language.errors import Diagnostic, Severity
from alula.language.messages import NO_MESSAGES, Messages
from alula.language.models import ModelFile
from alula.missions.part import NO_PART, MissionPart
from alula.model.model import Skillset
from alula.model.span import Span
from alula.trees.errors import FileError, Place, Problem
from alula.trees.library import Library

_WORD = re.compile(r"""<?[^\s=<>"'/]+""")
"""What a place without a length stands for: a tag, an attribute's name, a value."""


def findings_of(
    path: str,
    source: bytes,
    skillsets: Sequence[Skillset],
    palettes: Sequence[Path] = (),
    part: MissionPart = NO_PART,
    messages: Messages = NO_MESSAGES,
    library: Library | None = None,
    main: str = "",
    *,
    of_others: bool = False,
    enums: Collection[str] = (),
    checked: Library | None = None,
) -> list[Diagnostic]:
    """Return what `check_mission` finds wrong with a mission; what keeps it from being read at all is the only finding then (ALU0..)."""
    try:
        problems = check_mission(
            Path(path), source, skillsets, palettes, part, messages, library, main, of_others=of_others, enums=enums, checked=checked
        )
    except FileError as error:
        problem = error.problem
        code = problem.code if problem.code.startswith("ALU0") else "ALU004"
        problems = [replace(problem, code=code)]
    file = ModelFile(path, source.decode("utf-8", "replace"))
    return [_finding(problem, file) for problem in problems]


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
