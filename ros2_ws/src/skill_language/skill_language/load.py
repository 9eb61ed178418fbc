"""From files to models: one skillset, or a robot's folder with its types and bindings. All trouble is a LanguageError."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from skill_language import side_files
from skill_language.check import check
from skill_language.errors import Diagnostic, LanguageError, has_errors, nearest
from skill_language.lexer import MAX_CHARACTERS
from skill_language.model import Skillset, Span
from skill_language.paper import parse
from skill_language.robot import Bindings, Robot
from skill_language.ros_types import PRIMITIVES, RosType

SUFFIX = ".skill"


def load_skillset(path: str | Path) -> Skillset:
    """Return the checked skillset of a file.

    Raises:
        LanguageError: the file can't be read, or has errors; all of them are in it, warnings too.
    """
    skillset, findings = check_file(path)
    if skillset is None or has_errors(findings):
        raise LanguageError(findings)
    return skillset


def check_file(path: str | Path) -> tuple[Skillset | None, list[Diagnostic]]:
    """Return the skillset of a file, None where it can't even be parsed, and all findings about it."""
    try:
        text = read_text(Path(path))
        skillset = parse(text, str(path))
    except LanguageError as error:
        return None, list(error.diagnostics)
    lines = text.split("\n")
    return skillset, [_with_line(finding, lines) for finding in check(skillset)]


def read_text(path: Path) -> str:
    """Return a file's text with its line ends as newlines; raise LanguageError (ALU001 to ALU003) when it is no readable text."""
    try:
        if path.stat().st_size > 4 * MAX_CHARACTERS:
            raise LanguageError([_about(path, "ALU003", f"{path.stat().st_size} bytes are too much for a model")])
        return path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        message = f"not UTF-8 text: byte {error.start} is 0x{error.object[error.start]:02x}"
        raise LanguageError([_about(path, "ALU002", message)]) from error
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else "") or str(error)
        raise LanguageError([_about(path, "ALU001", f"can't be read: {reason}")]) from error


def load_robot(folder: str | Path) -> Robot:
    """Return a robot: every `*.skill` of a folder, with its `types.yaml` and `bindings.yaml` (both may be missing).

    Raises:
        LanguageError: with everything that is wrong in all of the files.
    """
    place = Path(folder)
    paths = sorted(place.glob(f"*{SUFFIX}"))
    if not paths:
        reason = f"no *{SUFFIX} file in it" if place.is_dir() else "is no folder"
        raise LanguageError([_about(place, "ALU006", reason)])
    findings: list[Diagnostic] = []
    skillsets: list[Skillset] = []
    files: dict[str, str] = {}
    for path in paths:
        skillset, found = check_file(path)
        findings += found
        if skillset is None:
            continue
        if skillset.name in files:
            message = f"skillset `{skillset.name}` is defined in {files[skillset.name]} already"
            findings.append(Diagnostic("ALU404", message, skillset.span))
        files.setdefault(skillset.name, f"{place.resolve().name}/{path.name}")
        skillsets.append(skillset)
    types, more = side_files.load_types(place / "types.yaml")
    findings += more
    bindings, more = side_files.load_bindings(place / "bindings.yaml")
    findings += more
    robot = Robot(place.resolve().name, tuple(skillsets), types, bindings, files)
    if len(skillsets) == len(paths):
        findings += _fit(robot, types, bindings, place)
    if has_errors(findings):
        raise LanguageError(findings)
    return robot


def _fit(robot: Robot, types: Mapping[str, RosType], bindings: Bindings, place: Path) -> list[Diagnostic]:
    """Return where models, types and bindings don't fit together."""
    findings: list[Diagnostic] = []
    all_data = {(skillset.name, data.name): data for skillset in robot.skillsets for data in skillset.data}
    for skillset in robot.skillsets:
        for name in skillset.types:
            if name not in types and name not in PRIMITIVES:
                hint = f"add `{name}: package/Name` to {place / 'types.yaml'}"
                findings.append(Diagnostic("ALU401", f"type `{name}` has no entry in types.yaml", skillset.span, hint=hint))
        for data in skillset.data:
            ros = types.get(data.type)
            if ros is not None and ros.message is None:
                message = f"data `{data.name}` is a list ({ros.interface}), and no topic carries a list by itself"
                findings.append(Diagnostic("ALU405", message, data.span, hint="give it a message type that has the list as a field"))
            if (skillset.name, data.name) not in bindings.data:
                hint = f"add `{skillset.name}.{data.name}: {{topic: /...}}` under `data:` in {place / 'bindings.yaml'}"
                findings.append(Diagnostic("ALU403", f"no topic is bound to data `{data.name}`", data.span, hint=hint))
    known = [".".join(key) for key in all_data]
    for key in bindings.data:
        if key not in all_data:
            name = ".".join(key)
            where = Span(str(place / "bindings.yaml"), 0, 0, 0)
            findings.append(Diagnostic("ALU402", f"`{name}` is bound, but there is no such data", where, hint=nearest(name, known)))
    return findings


def _with_line(finding: Diagnostic, lines: list[str]) -> Diagnostic:
    line = finding.span.line
    return replace(finding, source_line=lines[line - 1]) if 0 < line <= len(lines) else finding


def _about(path: Path, code: str, message: str) -> Diagnostic:
    return Diagnostic(code, message, Span(str(path), 0, 0, 0))
