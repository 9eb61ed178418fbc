"""From files to models: one skillset, or a robot's folder with its types and bindings. All errors are raised as LanguageError."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from alula.common.public import public
from alula.common.suggestions import nearest
from alula.language import side_files
from alula.language.errors import Diagnostic, LanguageError, Severity, has_errors
from alula.language.models import ModelFile, about, check_files, check_texts
from alula.language.notation import SUFFIXES
from alula.language.robot import Bindings, Robot
from alula.model.model import Skillset
from alula.model.ros_types import PRIMITIVES, RosType
from alula.model.span import Span


@public()
def load_skillset(path: str | Path) -> Skillset:
    """Return the checked skillset of a file.

    Raises:
        LanguageError: the file can't be read, or has errors; all of them are in it, warnings too.
    """
    (file,) = check_files([path])
    return _only(Path(path), file)


@public()
def parse_skillset(text: str, name: str = "model.skill") -> Skillset:
    """Return the checked skillset of a text; ``name`` stands in findings, and its suffix selects the notation: ``*.skill`` or ``*.rl``.

    Raises:
        LanguageError: the text has errors, or holds none or several skillsets.
    """
    (file,) = check_texts([ModelFile(name, text)])
    return _only(Path(name), file)


def _only(path: Path, file: ModelFile) -> Skillset:
    findings = file.findings
    one = len(file.skillsets) == 1 and not file.damaged
    if not one and not has_errors(findings):
        findings = [*findings, about(path, "ALU406", "one skillset is needed, and the file holds none or several")]
    if has_errors(findings):
        raise LanguageError(findings)
    return file.skillsets[0]


def check_file(path: str | Path) -> tuple[Skillset | None, list[Diagnostic]]:
    """Return the only skillset of a file, None where it has none, several or can't be read, and all findings about it."""
    (file,) = check_files([path])
    return (file.skillsets[0] if not file.damaged and len(file.skillsets) == 1 else None), file.findings


def load_robot(folder: str | Path) -> Robot:
    """Return a robot: every `*.skill` and `*.rl` of a folder, with its `types.yaml` and `bindings.yaml` (both may be missing).

    Raises:
        LanguageError: with everything that is wrong in all of the files.
    """
    place = Path(folder)
    paths = sorted(path for path in place.glob("*") if path.suffix in SUFFIXES)
    if not paths:
        reason = f"no {' or '.join(f'*{suffix}' for suffix in SUFFIXES)} file in it" if place.is_dir() else "is no folder"
        raise LanguageError([about(place, "ALU006", reason)])
    findings: list[Diagnostic] = []
    skillsets: list[Skillset] = []
    files: dict[str, str] = {}
    checked = check_files(paths)
    for path, file in zip(paths, checked, strict=True):
        findings += [_generated(finding) for finding in file.findings]
        skillsets += file.skillsets
        for skillset in file.skillsets:
            files.setdefault(skillset.name, f"{place.resolve().name}/{path.name}")
    types, more = side_files.load_types(place / "types.yaml")
    findings += more
    bindings, more = side_files.load_bindings(place / "bindings.yaml")
    findings += more
    robot = Robot(place.resolve().name, tuple(skillsets), types, bindings, files)
    if not any(file.damaged for file in checked):
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


def _generated(finding: Diagnostic) -> Diagnostic:
    """Return a finding as it counts for generated code."""
    return replace(finding, severity=Severity.ERROR) if finding.for_generator else finding
