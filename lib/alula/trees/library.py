"""Libraries of trees: the files of folders, whose trees and models others use without including them, and folders of ROS packages."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from pathlib import Path

from alula.trees.document import Document, Element, read_document, read_source
from alula.trees.errors import FileError, Problem, Report
from alula.trees.format3 import modernised
from alula.trees.node_type import CATEGORIES, Category, NodeType, node_type
from alula.trees.ports import Direction, Port
from alula.trees.values import ANY, TYPES

MODELS = "TreeNodesModel"
PROJECT = ".btproj"
"""The end of a name of Groot2's projects: files that include others, and have no main tree."""
ENDINGS = (".xml", PROJECT)
MARKS = (b"<BehaviorTree", b"<" + MODELS.encode())
"""What of the XML of a folder is a file of trees: others are packages, launch files, worlds."""
DIRECTIONS = {**{direction.value: direction for direction in Direction}, "bidirectional_port": Direction.INOUT}
"""Of ports, also as Nav2's palette writes them."""
MANIFEST = "package.xml"
_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")


def ignore(_problem: Problem) -> None:
    """Take no notice."""


class Library:
    """Files beside the one that is asked for: their trees are there for those who use them, their models for all.

    ``packages`` are folders of ROS packages by their names, for includes that name one: those that are given, those that the read folders
    hold, and those of the environment.
    """

    def __init__(self, packages: Mapping[str, Path] | None = None) -> None:
        self.documents: dict[Path, Document] = {}
        """By their resolved paths."""
        self.trees: dict[str, list[Element]] = {}
        self.models: dict[str, NodeType] = {}
        self.used: dict[str, set[Path]] = {}
        """Trees that are a part of others, each with the files that use it."""
        self.broken: list[Problem] = []
        """What keeps files from being read at all."""
        self._packages = dict(packages or {})
        self._read: dict[Path, Document] = {}
        """What was read, by this one and by those that have more besides; nothing is read twice."""

    def extended(self, places: Iterable[Path]) -> Library:
        """Return one with more files, for those who use them; raises nothing, as ``add``."""
        other = copy(self)
        other.documents, other.models, other.broken = dict(self.documents), dict(self.models), list(self.broken)
        other.trees = {name: list(found) for name, found in self.trees.items()}
        other.used = {name: set(found) for name, found in self.used.items()}
        other.add(places)
        return other

    def add(self, places: Iterable[Path]) -> None:
        """Read files, and those in folders; what can't be read is noted in ``broken``."""
        for path in (path for place in places for path in self.files(place)):
            if path.resolve() in self.documents:
                continue
            try:
                document = self.document(path)
            except FileError as error:
                self.broken.append(error.problem)
                continue
            if document.root.tag == "root":
                self.documents[path.resolve()] = document
                self._index(path.resolve(), document.root)

    def document(self, path: Path) -> Document:
        """Return a file, as format 4 has it; raises FileError."""
        found = self._read.get(path.resolve())
        if found is None:
            found = self._read[path.resolve()] = modernised(read_document(path))
        return found

    def files(self, place: Path) -> list[Path]:
        """Return the files of trees in a folder, in the order of their names; the place itself where it is none."""
        if not place.is_dir():
            return [place]
        found = []
        for folder, inner, names in os.walk(place):
            inner[:] = sorted(name for name in inner if not name.startswith("."))
            if MANIFEST in names:
                self._packages.setdefault(_package_name(Path(folder)), Path(folder))
            found += [Path(folder, name) for name in sorted(names) if name.endswith(ENDINGS)]
        return [path for path in found if _is_of_trees(path)]

    def _index(self, path: Path, root: Element) -> None:
        for element in root.children:
            if element.tag == "BehaviorTree":
                if element.get("ID"):
                    self.trees.setdefault(element.get("ID"), []).append(element)
                for one in element.iterate():
                    if one.tag == Category.SUBTREE.value:
                        self.used.setdefault(one.get("ID"), set()).add(path)
            elif element.tag == MODELS:
                for model in models_of(element, ignore):
                    self.models.setdefault(model.name, model)

    def elements(self) -> Iterator[Element]:
        """Yield all trees, file by file, also those without an ID."""
        for document in self.documents.values():
            yield from (one for one in document.root.children if one.tag == "BehaviorTree")

    def tree(self, name: str, user: str) -> Element | None:
        """Return the tree of a name that a file uses: the one nearest to it, of equally near ones the first; None where there is none."""
        folder = Path(user).parent.resolve()
        return min(self.trees.get(name, ()), key=lambda one: _steps(folder, Path(one.place.path).parent.resolve()), default=None)

    def has_user(self, tree: Element) -> bool:
        """Return whether another file takes this very tree, and not one of the same name that stands nearer to it."""
        name = tree.get("ID")
        having = {Path(one.place.path).resolve() for one in self.trees.get(name, ())}
        taken = (self.tree(name, str(user)) for user in self.used.get(name, set()) - having)
        return any(one is not None and one.place == tree.place for one in taken)

    def package(self, name: str, user: Path) -> Path | None:
        """Return the folder of a ROS package that a file names: one that is known, the one the file lies in, one of the environment."""
        if name not in self._packages:
            around = [folder for folder in user.resolve().parents if (folder / MANIFEST).is_file()]
            found = [folder for folder in around if _package_name(folder) == name] or list(_sourced(name))
            if not found:
                return None
            self._packages[name] = found[0]
        return self._packages[name]


def _is_of_trees(path: Path) -> bool:
    try:
        content = read_source(path)
    except FileError:
        return True  # which is told where it is read
    return path.name.endswith(PROJECT) or any(mark in content for mark in MARKS)


def _package_name(folder: Path) -> str:
    """Return the name that a package's manifest gives it, else that of its folder."""
    try:
        match = _NAME.search((folder / MANIFEST).read_bytes())
    except OSError:
        match = None
    return match[1].decode("utf-8", "replace") if match else folder.name


def _sourced(name: str) -> Iterator[Path]:
    """Yield the folders of a package in the ROS environments that are sourced: ROS 2's prefixes, ROS 1's paths."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        if (folder := Path(prefix) / "share" / name).is_dir():
            yield folder
    for path in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield from (one.parent for one in Path(path).glob(f"**/{name}/{MANIFEST}"))


def _steps(one: Path, other: Path) -> int:
    """Return how many steps lead from a folder to another."""
    common = len(Path(os.path.commonpath((one, other))).parts)
    return len(one.parts) + len(other.parts) - 2 * common


def models_of(element: Element, report: Report) -> Iterator[NodeType]:
    """Yield the types of node that a <TreeNodesModel> declares."""
    for one in element.children:
        category = CATEGORIES.get(one.tag)
        if category is None:
            continue  # editors keep there what they know besides
        if not one.get("ID"):
            report(Problem(one.place, f"<{one.tag}> without an ID is the model of no node", f'write <{one.tag} ID="...">'))
        else:
            ports = [port_of(port) for port in one.children if port.tag in DIRECTIONS]
            yield node_type(one.get("ID"), category, ports)


def port_of(element: Element) -> Port:
    """Return a port of such a type."""
    default = element.get("default") if "default" in element.attributes else None
    doc = element.get("description") or "".join(part for part in element.content if isinstance(part, str)).strip()
    place = None if default is None else element.place_of("default")
    return Port(element.get("name"), TYPES.get(element.get("type"), ANY), DIRECTIONS[element.tag], default, doc, place=place)
