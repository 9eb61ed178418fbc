"""The mission to repair: its file, its robot, and changed copies of the file, which can be judged in the same way."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from alula.check.findings import findings_of
from alula.check.robot import Warn, models_of, part_of
from alula.common.errors import AlulaError
from alula.common.robots import RobotFolder, find_robot
from alula.common.scenarios import Scenario
from alula.language.errors import Diagnostic
from alula.language.messages import Messages, messages_of
from alula.missions.mission_file import MissionFile
from alula.missions.part import MissionPart
from alula.missions.scenario import by_mission, flown
from alula.model.model import Skillset
from alula.odds.mission import Brought
from alula.odds.robot import brought_about
from alula.prove.mission.accepted import DESCRIPTION
from alula.prove.mission.wanted import PROPERTY
from alula.records.causes.effects import FaultEffects
from alula.records.causes.fault_file import effects_of
from alula.records.models import members
from alula.repair.errors import RepairError
from alula.repair.naming import Vocabulary
from alula.trees.attributes import node_name
from alula.trees.document import Document, Element, parse_document, read_source
from alula.trees.reading import TreeFiles
from alula.trees.source import TreeSource

AtRest = Sequence[tuple[str, str]]
"""Each ``skillset.resource`` and its state: in one of them a robot need not be brought anywhere."""
_ACTIVE = re.compile(r"active\(\s*['\"](?P<node>[^'\"]+)['\"]\s*\)")
_PROPERTY = re.compile(rf"\s*{PROPERTY.pattern};?", re.DOTALL)


@dataclass(frozen=True)
class Subject:
    """A mission's file and what it is read with.

    Attributes:
        flown_as: the mission's file that a scenario has inputs for: this one, else one with a main tree of the same name; else this one.
        mission: what was read, with the library of this scenario.
        faults: what each fault of the robot brings about.
        brought: by a skill, the states that its success brings about in the functional layer.
        at_first: the states that come by themselves after power-up.
    """

    path: Path
    flown_as: Path
    source: bytes
    mission: MissionFile
    robot: RobotFolder
    messages: Messages
    faults: Mapping[str, FaultEffects]
    brought: Brought
    at_first: frozenset[tuple[str, str]]

    @classmethod
    def read(cls, path: Path, tell: Warn) -> Subject:
        """Read a mission of the robot of the current folder; raises AlulaError where a file can't be read."""
        robot = find_robot()
        models = models_of(robot, tell)
        if not models:
            raise RepairError(f"{path}: the robot in {robot.root} has no skills to repair it with")
        faults = effects_of(robot, models).known
        source = read_source(path)
        flown_as, scenario = _flown_as(path, parse_document(source, str(path)).root)
        tree = TreeSource(path) if scenario is None else flown(path, scenario)
        mission, messages = MissionFile.read(tree, models, part_of(robot, tell)), messages_of(robot)
        return cls(path, flown_as, source, mission, robot, messages, faults, *brought_about(robot, models))

    @property
    def files(self) -> TreeFiles:
        """The mission's trees."""
        return self.mission.files

    @property
    def skillsets(self) -> tuple[Skillset, ...]:
        """The robot's models."""
        return self.mission.skillsets

    @property
    def part(self) -> MissionPart:
        """What the robot adds to missions."""
        return self.mission.part

    def changed(self, path: Path) -> MissionFile:
        """Read a copy of the mission with changes; raises FileError."""
        return MissionFile.read(TreeSource(path, self.mission.source.library), self.skillsets, self.part)

    @property
    def shown(self) -> Mapping[str, frozenset[str]]:
        """The states in which faults show, as properties ask for them."""
        return {name: one.states for name, one in self.faults.items() if one.states}

    @property
    def at_rest(self) -> list[AtRest]:
        """The states of resources in which each robot may be left, as the file has them."""
        return _at_rest(self.robot, self.skillsets)

    def document(self) -> Document:
        """Return the file as a document that may be changed."""
        return parse_document(self.source, str(self.path))

    def findings(self, text: str) -> list[Diagnostic]:
        """Return what `check` finds in another text of the file without looking at its runs."""
        return findings_of(str(self.path), text.encode(), self.skillsets, (), self.part, self.messages, self.mission.source.library)

    @contextmanager
    def copy(self, text: str) -> Iterator[Path]:
        """Yield the path of a file with this text, beside copies of what it includes, as long as the context lasts."""
        documents = [Path(one.path).resolve() for one in self.files.documents]
        top = Path(os.path.commonpath([one.parent for one in documents]))
        with tempfile.TemporaryDirectory(prefix="alula-repair-") as folder:
            for one in documents:
                place = Path(folder) / one.relative_to(top)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(one, place)
            changed = Path(folder) / documents[0].relative_to(top)
            changed.write_bytes(text.encode())
            yield changed

    def vocabulary(self) -> Vocabulary:
        """Return the author's names: of this mission, then of the robot's others that can be read."""
        own = {Path(one.path).resolve() for one in self.files.documents} | {self.flown_as.resolve()}
        nodes = list(_nodes(self.files))
        for path, scenario in by_mission().items():
            with suppress(AlulaError, OSError):
                nodes += _nodes(flown(path, scenario).read()) if path not in own else ()
        return Vocabulary(nodes)

    # --- properties --------------------------------------------------------------------------------------------------

    def names_asked(self) -> dict[str, None]:
        """Return the names of nodes in the mission's properties that no tree has, in the order of the file."""
        elements = [one for tree in self.files.trees.values() for one in tree.iterate()]
        there = {node_name(one) for one in elements}
        asked = (match["node"] for one in elements for match in _ACTIVE.finditer(one.get(DESCRIPTION)))
        return {name: None for name in asked if name not in there}


def _at_rest(robot: RobotFolder, skillsets: Sequence[Skillset]) -> list[AtRest]:
    """Return it for each robot of a fleet, else for the robot; nothing for one whose file says none."""
    if robot.robots:
        each = ((one.name, _at_rest(one.robot, one.skillsets)) for one in members(robot, skillsets))
        return [[(name(at), state) for at, state in one] for name, several in each for one in several]
    said = (robot.departure, robot.rest, robot.taken)
    names = {resource: of.name for of in skillsets for resource in of.resource_index}
    found = [(f"{names[one[0]]}.{one[0]}", one[1]) for one in said if one is not None and one[0] in names]
    return [found] if found else []


def _nodes(files: TreeFiles) -> Iterator[Element]:
    return (one for tree in files.trees.values() for one in tree.iterate())


def _flown_as(path: Path, root: Element) -> tuple[Path, Scenario | None]:
    missions = by_mission()
    if path.resolve() in missions:
        return path, missions[path.resolve()]
    alike = (
        one for one in missions.items() if one[0].is_file() and _main(parse_document(read_source(one[0]), str(one[0])).root) == _main(root)
    )
    return next(alike, (path, None))


def _main(root: Element) -> str:
    return root.get("main_tree_to_execute") or next((one.get("ID") for one in root.children if one.tag == "BehaviorTree"), "")


def without_properties_of(root: Element, missing: Collection[str]) -> list[str]:
    """Remove the properties that name these nodes from a file's descriptions; return the names of the properties."""
    taken: list[str] = []
    for element in root.iterate():
        text = element.get(DESCRIPTION)

        def without(match: re.Match[str]) -> str:
            if not any(one["node"] in missing for one in _ACTIVE.finditer(match[0])):
                return match[0]
            taken.append(match["name"])
            return ""

        left = _PROPERTY.sub(without, text) if text and missing else text
        if left != text:
            element.set(DESCRIPTION, left)
    return taken


def with_property(root: Element, main: str, text: str) -> None:
    """Add a property to the description of a tree's top node."""
    tree = next((one for one in root.children if one.get("ID") == main), None)
    if tree is not None and text:
        top = tree.children[0]
        top.set(DESCRIPTION, f"{top.get(DESCRIPTION).rstrip().rstrip(';')}; property {text};".lstrip("; "))


def texts_of(root: Element) -> Sequence[str]:
    """Return all texts of a file in names, comments and attributes: they show its author's spelling."""
    parts = [part for one in root.iterate() for part in one.content if isinstance(part, str)]
    return [*parts, *(one.value for element in root.iterate() for one in element.attributes.values())]
