"""Missions in the editor: findings, what may be written next, and what a name stands for, by the models of the robot around the file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from alula.check.findings import findings_of
from alula.check.skills import Skills
from alula.common.robots import RobotError, find_robot
from alula.editor.completion import Completion, Place
from alula.editor.tree_names import TreeFolder
from alula.language.errors import Diagnostic, Severity
from alula.language.messages import FieldError, messages_of
from alula.language.models import ModelFile, check_files, models_in
from alula.missions.environment import FUNCTIONS
from alula.missions.part import NO_PART, MissionPart
from alula.missions.registry import mission_registry
from alula.missions.skill_types import SUCCESS_PORT
from alula.model.model import ResultKind, Skill, Skillset
from alula.trees.attributes import POSTCONDITIONS, PRECONDITIONS
from alula.trees.node_type import Category, NodeType
from alula.trees.registry import NodeRegistry

SUFFIX = ".xml"
UNKNOWN_NODE = "ALU601"
Opened = Mapping[Path, tuple[object, str]]
"""The texts that the editor has, by their paths, each with its version."""
NOTHING_OPEN: Opened = {}
_TAG = re.compile(r"<([\w.]*)$")
_VALUE = re.compile(r"""([\w:]+)\s*=\s*(?:"([^"]*)|'([^']*))$""")
_OPEN = re.compile(r"""<([\w.]+)((?:\s+[\w:]+\s*=\s*(?:"[^"]*"|'[^']*'))*)\s*([^<>]*)$""")
_ID = re.compile(r"""\bID\s*=\s*["']([^"']*)""")
_STATE = re.compile(r"(\w+)\.(\w+)\s*(?:==|!=)\s*'?\w*$")
_CALL = re.compile(r"(\w+)\(\s*[\w.]*$")
_MEMBER = re.compile(r"(\w+)\.((?:\w+\.)*)\w*$")
_WORD = re.compile(r"[\w.]+")
_SCRIPTS = frozenset({"code", "if", "otherwise", *PRECONDITIONS, *POSTCONDITIONS})


class Missions:
    """Reads missions with the models of their robots, which are read again when their files have changed.

    ``trusted``: a robot's Python is imported for the nodes that it adds. Otherwise opening a file runs nothing of what lies around it,
    and a node that nobody knows may be the robot's: a note instead of an error.
    """

    def __init__(self, *, trusted: bool = False) -> None:
        self.trusted = trusted
        self._folders: dict[Path, TreeFolder] = {}
        self._read: dict[tuple[tuple[str, int], ...], tuple[Skillset, ...]] = {}

    def folder(self, path: str, opened: Opened) -> TreeFolder:
        """Return the trees around a file as they are now; ``opened`` are the texts that the editor has."""
        made = TreeFolder.around(Path(path))
        folder = self._folders.setdefault(made.place, made)
        folder.refresh(opened)
        return folder

    def checked(self, path: str, text: str, opened: Opened = NOTHING_OPEN) -> ModelFile:
        """Return a mission with its findings; the trees around it are a library for it."""
        file = ModelFile(path, text)
        skills = self.skills(path)
        skillsets = tuple(skills.skillsets.values())
        library = self.folder(path, opened).library() if Path(path).is_absolute() else None
        others = not self._has_robot(path)
        part, source = self._part(path), text.encode("utf-8", "replace")
        found = findings_of(path, source, skillsets, part=part, messages=skills.messages, library=library, of_others=others)
        found = [one for one in found if one.span.file == path]  # what is wrong in another file is told there
        file.findings = [_perhaps_own(one) for one in found] if self._has_untrusted_part(path) else found
        return file

    def skills(self, path: str) -> Skills:
        """Return the skills of the robot whose folder a file lies in, none where there is no robot."""
        try:
            robot = find_robot(Path(path).parent)
            places = models_in(str(robot.skillsets))
            stamps = tuple((place, Path(place).stat().st_mtime_ns) for place in places)
        except (RobotError, OSError):
            return Skills(())
        if stamps not in self._read:
            self._read = {stamps: tuple(skillset for file in check_files(places) for skillset in file.skillsets)}
        return Skills(self._read[stamps], messages_of(robot))

    def completions(self, file: ModelFile, place: Place, opened: Opened = NOTHING_OPEN) -> list[Completion]:
        """Return what may stand at a place."""
        folder = self.folder(file.path, opened)
        lines = file.text.split("\n")[: place.line]
        before = "\n".join([*lines[:-1], lines[-1][: place.column - 1]]) if lines else ""
        return list(_candidates(before, self.skills(file.path), self._part(file.path), folder))

    def description(self, file: ModelFile, place: Place) -> tuple[str, int, int] | None:
        """Return what the name at a place stands for, with its first column and the one behind it; None where nothing is known."""
        skills = self.skills(file.path)
        for match in _WORD.finditer(file.line(place.line)):
            if match.start() < place.column <= match.end() + 1:
                text = _described(match.group(), skills)
                return (text, match.start() + 1, match.end() + 1) if text else None
        return None

    def _part(self, path: str) -> MissionPart:
        """Return what the robot whose folder a file lies in adds to missions; nothing where it is not known."""
        if not self.trusted:
            return NO_PART
        try:
            return find_robot(Path(path).parent).part("missions") or NO_PART
        except RobotError:
            return NO_PART

    def _has_robot(self, path: str) -> bool:
        try:
            return find_robot(Path(path).parent) is not None
        except RobotError:
            return False

    def _has_untrusted_part(self, path: str) -> bool:
        try:
            return not self.trusted and "missions" in find_robot(Path(path).parent).parts
        except RobotError:
            return False


def _perhaps_own(finding: Diagnostic) -> Diagnostic:
    if finding.code != UNKNOWN_NODE:
        return finding
    cure = "the editor runs no Python of a robot unless it is started as `alula editor --trust`; `alula check` knows all nodes"
    return replace(finding, severity=Severity.NOTE, message=f"{finding.message}, unless it is the robot's own", hint=cure)


def _candidates(before: str, skills: Skills, part: MissionPart, folder: TreeFolder) -> Iterator[Completion]:
    types = mission_registry(tuple(skills.skillsets.values()), part)
    declared = [one for one in folder.models.values() if one.category is not Category.SUBTREE and types.get(one.name) is None]
    types = types | NodeRegistry(declared)
    if _TAG.search(before):
        yield from (Completion(one.name, "skill" if skills.get(one.name) else "keyword", one.doc) for one in types)
        return
    opened = _OPEN.search(before)
    if opened is None:
        return
    node, value = types.get(opened[1]), _VALUE.search(before)
    if opened[1] == Category.SUBTREE.value:
        used = _ID.search(opened[2])
        node = folder.models.get(used[1]) if used else None
        if value is not None and value[1] == "ID":
            yield from (Completion(name, "skill", str(found[0].place)) for name, found in sorted(folder.trees.items()))
            return
    if value is not None:
        yield from _values(value[1], value[2] or value[3] or "", opened[1], skills)
    elif node is not None:
        yield from _ports(node, opened[2])


def _ports(node: NodeType, given: str) -> Iterator[Completion]:
    for port in node.ports.values():
        if not re.search(rf"\b{port.name}\s*=", given):
            yield Completion(port.name, "data", " ".join(filter(None, (port.type.name, port.unit, port.doc))))
    yield from (Completion(name, "keyword", "a script") for name in (*PRECONDITIONS, *POSTCONDITIONS))


def _values(attribute: str, text: str, tag: str, skills: Skills) -> Iterator[Completion]:
    skill = skills.get(tag)
    if attribute == SUCCESS_PORT and skill is not None:
        yield from (Completion(one.name, "state", one.comment) for one in skill.results)
    elif attribute == "ID":
        yield from (Completion(name, "skill") for name in sorted(skills.names["skill"]))
    elif attribute in _SCRIPTS:
        yield from _in_script(text, skills)


def _in_script(text: str, skills: Skills) -> Iterator[Completion]:
    """Yield states behind a comparison, names of skills in a call, members behind a skillset's dot, else all that may begin."""
    compared, called, member = _STATE.search(text), _CALL.search(text), _MEMBER.search(text)
    if compared and compared[1] in skills.skillsets:
        resource = skills.skillsets[compared[1]].resource_index.get(compared[2])
        yield from (Completion(state, "state") for state in (resource.states if resource else ()))
    elif called and called[1] in FUNCTIONS:
        yield from (Completion(name, "skill") for name in sorted(skills.names[FUNCTIONS[called[1]].kind]))
    elif member and member[1] in skills.skillsets:
        skillset = skills.skillsets[member[1]]
        data, *path = member[2].split(".")[:-1] or [""]
        if data:
            fields = skills.messages.inside(skillset.data_index[data].type, path) if data in skillset.data_index else {}
            yield from (Completion(name, "data", one.interface if one else "") for name, one in fields.items())
            return
        yield from (Completion(name, "resource") for name in skillset.resource_index)
        yield from (Completion(name, "data") for name in skillset.data_index)
    else:
        yield from (Completion(f"{name}(", "keyword", f"of a {one.kind}") for name, one in FUNCTIONS.items())
        yield from (Completion(name, "resource") for name in sorted(skills.names["resource"]))


def _described(name: str, skills: Skills) -> str:
    skill = skills.get(name)
    if skill is not None:
        return _skill_text(name, skill)
    skillset, _, resource = name.partition(".")
    known = skills.skillsets.get(skillset)
    if known and resource in known.resource_index:
        return f"resource {name} {{ {' '.join(known.resource_index[resource].states)} }}"
    data, *path = resource.split(".")
    if known and data in known.data_index:
        with suppress(FieldError):
            field = skills.messages.field(known.data_index[data].type, path)
            return f"data {name}: {field.interface}" if field else f"data {name}"
    return ""


def _skill_text(name: str, skill: Skill) -> str:
    """Return a skill as its model has it: inputs, outputs, results with what they are."""
    lines = [f"skill {name}"]
    for word, parameters in (("input", skill.inputs), ("output", skill.outputs)):
        lines += [f"  {word} {one.name}: {one.type}" + (f" // {one.comment}" if one.comment else "") for one in parameters]
    for result in skill.results:
        kind = skill.kind_of(result.name)
        word = "result" if kind is ResultKind.PLAIN else kind.value
        lines.append(f"  {word} {result.name}" + (f" // {result.comment}" if result.comment else ""))
    return "\n".join(lines)
