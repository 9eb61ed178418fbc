"""The missions of a robot from trees: a file for each main tree with what it alone needs, and one with the trees that several need."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.adopt.converting import TREES, complete, converted
from alula.adopt.entries import Entries, GivenEntry
from alula.adopt.foreign import elements_of
from alula.adopt.naming import Names, snake
from alula.adopt.vocabulary import Vocabulary
from alula.trees.document import Element, quoted, read_document
from alula.trees.format3 import DECLARED, FORMAT
from alula.trees.node_type import Category, NodeType
from alula.trees.ports import Port
from alula.trees.reading import LIBRARY, TreeFiles
from alula.trees.registry import NodeRegistry

SHARED = "shared"
"""The file of the trees that several missions use."""
COMMENTS = re.compile(r"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True)
class MissionOf:
    """A main tree as a mission; ``source`` is its file relative to the folder, ``trees`` are the trees that it needs, by ID."""

    name: str
    source: str
    files: TreeFiles
    given: Sequence[GivenEntry]

    @property
    def main(self) -> str:
        """The ID of its main tree."""
        return self.files.main


class Missions:
    """All missions of a robot, and their files."""

    def __init__(self, mains: Sequence[TreeFiles], vocabulary: Vocabulary, known: NodeRegistry, folder: Path) -> None:
        self._comments = _comments(elements_of(mains))
        names = _names(mains)
        new = {id(tree): converted(tree, name, vocabulary) for files in mains for name, tree in files.trees.items()}
        self._old = {id(new[id(tree)]): tree for tree in elements_of(mains)}
        missions = [_converted(files, new) for files in mains]
        self.entries = Entries(missions, vocabulary, known)
        for tree in new.values():
            complete(tree, vocabulary, self.entries.zeros())
        self.all = [
            MissionOf(name, _told(files, folder), mission, self.entries.given(mission))
            for name, files, mission in zip(names, mains, missions, strict=True)
        ]

    def texts(self) -> dict[str, str]:
        """Return the files' texts by their names."""
        shared = self._shared()
        found = {}
        for one in self.all:
            own = {name: tree for name, tree in one.files.trees.items() if name not in shared}
            main = {port.name: Port(port.name) for port in one.given}
            models = {**_models(one.files, own), one.main: main}
            attributes = {
                DECLARED: FORMAT,
                "main_tree_to_execute": one.main,
                **({LIBRARY: f"{SHARED}.xml"} if len(own) < len(one.files.trees) else {}),
            }
            found[f"{one.name}.xml"] = self._text(attributes, {one.main: own[one.main], **own}, models)
        if shared:
            models = {name: ports for one in self.all for name, ports in _models(one.files, shared).items()}
            found[f"{SHARED}.xml"] = self._text({DECLARED: FORMAT}, shared, models)
        return found

    def _shared(self) -> dict[str, Element]:
        """Return the trees that several missions use, but for main ones, and those of whose ID there are several."""
        users = Counter(id(tree) for one in self.all for tree in one.files.trees.values())
        having: dict[str, set[int]] = {}
        for name, tree in (pair for one in self.all for pair in one.files.trees.items()):
            having.setdefault(name, set()).add(id(tree))
        mains = {one.main for one in self.all}
        trees = {name: tree for one in self.all for name, tree in one.files.trees.items()}
        return {name: tree for name, tree in trees.items() if users[id(tree)] > 1 and len(having[name]) == 1 and name not in mains}

    def _text(self, attributes: Mapping[str, str], trees: Mapping[str, Element], models: Mapping[str, Mapping[str, Port]]) -> str:
        lines = ["<root" + "".join(f" {name}={quoted(value)}" for name, value in attributes.items()) + ">"]
        for tree in trees.values():
            lines += [f"  {comment}" for comment in self._comments[id(self._old[id(tree)])]]
            lines += ["  " + "".join(tree.pieces()), ""]
        lines += ["  <TreeNodesModel>"] if any(models.values()) else []
        for name, ports in models.items():
            lines += (
                [f"    <{Category.SUBTREE.value} ID={quoted(name)}>", *map(_port, ports.values()), f"    </{Category.SUBTREE.value}>"]
                if ports
                else []
            )
        lines += ["  </TreeNodesModel>"] if any(models.values()) else []
        return "\n".join([*lines, "</root>", ""])


def _port(port: Port) -> str:
    default = f" default={quoted(port.default)}" if port.default is not None else ""
    return f"      <{port.direction.value} name={quoted(port.name)}{default}/>"


def _models(files: TreeFiles, trees: Mapping[str, Element]) -> dict[str, Mapping[str, Port]]:
    """Return the ports of trees that files declare."""
    names = {TREES.get(name, name): one for name, one in files.models.items() if one.category is Category.SUBTREE}
    return {name: names[name].ports for name in trees if name in names}


def _converted(files: TreeFiles, new: Mapping[int, Element]) -> TreeFiles:
    trees = {TREES.get(name, name): new[id(tree)] for name, tree in files.trees.items()}
    models: dict[str, NodeType] = {name: one for name, one in files.models.items() if one.category is Category.SUBTREE}
    return TreeFiles(files.documents, trees, models, TREES.get(files.main, files.main))


def _names(mains: Sequence[TreeFiles]) -> list[str]:
    """Return a name for each main tree: that of its ID, or where it has none, or others have the same, that of its file."""
    count = Counter(snake(files.main) for files in mains)
    names = Names("mission", [SHARED])
    return [names.add(files.main if _has_id(files) and count[snake(files.main)] == 1 else _stem(files)) for files in mains]


def _has_id(files: TreeFiles) -> bool:
    return bool(files.trees[files.main].get("ID"))


def _stem(files: TreeFiles) -> str:
    return Path(files.path).stem


def _told(files: TreeFiles, folder: Path) -> str:
    path = Path(files.trees[files.main].place.path)
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.name


def _comments(trees: Iterable[Element]) -> dict[int, list[str]]:
    """Return by the identity of each tree the comments that stand before it in its file."""
    documents: dict[str, dict[int, list[str]]] = {}
    for tree in trees:
        if tree.place.path not in documents:
            documents[tree.place.path] = _comments_of(Path(tree.place.path))
    return {id(tree): documents[tree.place.path].get(tree.place.line, []) for tree in trees}


def _comments_of(path: Path) -> dict[int, list[str]]:
    """Return the comments that stand before trees of a file, by the lines of those."""
    found: dict[int, list[str]] = {}
    said: list[str] = []
    for part in read_document(path).root.content:
        if isinstance(part, str):
            said += COMMENTS.findall(part)
        else:
            found[part.place.line] = said
            said = []
    return found
