"""Names of trees in the editor: the IDs and entries of a folder's trees, where they are defined and used, and under which other name.

A folder is what lies around a mission's file: the robot's missions, the ROS package, else the file's own folder. Files are read again when
they have changed; what the editor has open counts as it is there. A file that is broken at the moment keeps what was read of it last.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.editor.names import RenameError
from alula.missions.mission_file import READY, STOP_HERE
from alula.model.span import Span
from alula.trees.attributes import AUTOREMAP, POSTCONDITIONS, PRECONDITIONS, is_port, type_name
from alula.trees.document import Attribute, Document, Element, parse_document, read_source
from alula.trees.errors import FileError, Place
from alula.trees.library import MANIFEST, MARKS, MODELS, Library, models_of
from alula.trees.library import ignore as ignore_problem
from alula.trees.node import pointer
from alula.trees.node_type import Category, NodeType
from alula.trees.reading import FORBIDDEN
from alula.trees.script import ScriptError
from alula.trees.script.lexer import Kind, tokenize

MAIN = "main_tree_to_execute"
TREE, SUBTREE = "BehaviorTree", Category.SUBTREE.value
SCRIPTS = frozenset({"code", "if", "otherwise", *PRECONDITIONS, *POSTCONDITIONS})
ENTRY = re.compile(r"[A-Za-z_]\w*")
ON = frozenset({"1", "true"})


@dataclass(frozen=True)
class TreeName:
    """A name under the cursor, with its place: the ID of a tree, a type of node, or an entry of the blackboard of the tree ``tree``."""

    kind: str
    name: str
    span: Span
    tree: str = ""


@dataclass(frozen=True)
class Use:
    """A place of a name; ``text`` is what stands there under another name (with `{}` for it) where that is not the name alone."""

    span: Span
    defining: bool = False
    text: str = "{}"


class TreeFolder:
    """The trees of a folder, as the disk has them and as the editor has those that are open."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.documents: dict[Path, Document] = {}
        self._stamps: dict[Path, object] = {}
        self._library: tuple[object, Library] | None = None
        self.models: dict[str, NodeType] = {}
        self.trees: dict[str, list[Element]] = {}

    @classmethod
    def around(cls, path: Path) -> TreeFolder:
        """Return the folder around a file, without reading it."""
        packages = [folder for folder in path.parents if (folder / MANIFEST).is_file()]
        return cls(packages[0] if packages else path.parent)

    def refresh(self, opened: Mapping[Path, tuple[object, str]]) -> None:
        """Read the files that have changed; ``opened`` are the texts in the editor, by path, each with its version."""
        there: dict[Path, object] = {path: version for path, (version, _) in opened.items() if self.place in path.parents}
        for path in self.place.rglob("*.xml"):
            if path not in there and not any(part.startswith(".") for part in path.relative_to(self.place).parts):
                stat = path.stat()
                there[path] = stat.st_mtime_ns, stat.st_size
        if there == self._stamps:
            return
        for path in [path for path in there if self._stamps.get(path) != there[path]]:
            self._read(path, opened[path][1].encode("utf-8", "replace") if path in opened else None)
        self._stamps = there
        self.documents = {path: document for path, document in self.documents.items() if path in there}
        self._index()

    def _read(self, path: Path, source: bytes | None) -> None:
        try:
            content = read_source(path) if source is None else source
            if not any(mark in content for mark in MARKS):
                self.documents.pop(path, None)
                return
            self.documents[path] = parse_document(content, str(path))
        except FileError:
            return  # what is being written: what was read last holds

    def _index(self) -> None:
        self.trees, self.models = {}, {}
        for document in self.documents.values():
            for element in document.root.children:
                if element.tag == TREE and element.get("ID"):
                    self.trees.setdefault(element.get("ID"), []).append(element)
                elif element.tag == MODELS:
                    for model in models_of(element, ignore_problem):
                        self.models.setdefault(model.name, model)

    def library(self) -> Library:
        """Return the trees of the folder as the disk has them, for a check of one of its files."""
        on_disk = {path: stamp for path, stamp in self._stamps.items() if isinstance(stamp, tuple)}
        if self._library is None or self._library[0] != on_disk:
            library = Library()
            library.add([self.place])
            self._library = on_disk, library
        return self._library[1]

    # --- what stands where ----------------------------------------------------------------------------------------------

    def at(self, path: Path, line: int, column: int) -> TreeName | None:
        """Return the name at a place, 1-based; None where there is none that leads somewhere."""
        document = self.documents.get(path)
        for found in () if document is None else self._names(document):
            if found.span.line == line and found.span.column <= column <= found.span.end_column:
                return found
        return None

    def _names(self, document: Document) -> Iterator[TreeName]:
        for name, place in _ids(document):
            yield TreeName("tree", name, place.span)
        for element in document.root.children:
            if element.tag == TREE:
                tree = element.get("ID")
                for key, use in _entries(element):
                    yield TreeName("entry", key, use.span, tree)
                for node in (one for top in element.children for one in top.iterate()):
                    if node.tag in self.models:
                        yield TreeName("node", node.tag, _span(node.place, len(node.tag), after=1))

    def uses(self, asked: TreeName) -> list[Use]:
        """Return all places of a name in the folder."""
        if asked.kind == "tree":
            return [use for document in self.documents.values() for name, use in _ids(document) if name == asked.name]
        if asked.kind == "node":
            return [use for document in self.documents.values() for name, use in _nodes(document) if name == asked.name]
        return list(self._entry_uses(asked.tree, asked.name))

    def definition(self, asked: TreeName) -> Span | None:
        """Return where a name is defined: a tree by its element, a node by its model, an entry where its tree names it first."""
        found = self.uses(asked)
        return next((one.span for one in found if one.defining), found[0].span if asked.kind == "entry" and found else None)

    def renamed(self, asked: TreeName, name: str) -> dict[str, list[tuple[Span, str]]]:
        """Return the texts that another name has put in, by file; raises RenameError where that can't be or would change the meaning."""
        if asked.kind == "node":
            raise RenameError(f"`{asked.name}` is a type of node, which a program registers under this name")
        if asked.kind == "tree":
            if not name or FORBIDDEN.search(name):
                raise RenameError(f"`{name[:40]}` is no ID of a tree: it has letters, digits, `_` and `-`")
            if name in self.trees:
                raise RenameError(f"there is a tree `{name}` at {self.trees[name][0].place}")
        else:
            if not ENTRY.fullmatch(name):
                raise RenameError(f"`{name[:40]}` is no name of an entry: names are made of a-z, A-Z, 0-9 and _")
            taken = next(iter(self._entry_uses(asked.tree, name)), None)
            if taken is not None:
                raise RenameError(f"there is an entry `{name}` already at {taken.span}")
        changes: dict[str, list[tuple[Span, str]]] = {}
        for use in self.uses(asked):
            changes.setdefault(use.span.file, []).append((use.span, use.text.replace("{}", name)))
        return changes

    # --- entries -----------------------------------------------------------------------------------------------------------

    def _entry_uses(self, tree: str, entry: str) -> Iterator[Use]:
        """Yield the places of an entry in all trees that share it."""
        for name in self._sharing(tree, entry):
            for element in self.trees.get(name, ()):
                yield from (use for key, use in _entries(element) if key == entry)
            yield from self._as_port(name, entry)

    def _sharing(self, tree: str, entry: str) -> list[str]:
        """Return the trees whose entry of this name is the same one: those that remap all, and those of one mission."""
        found, left = [tree], [tree]
        while left:
            name = left.pop()
            others = [parent for parent, use in self._subtree_uses(name) if _remaps_all(use, entry)]
            for element in self.trees.get(name, ()):
                inner = (one for one in element.iterate() if one.tag == SUBTREE)
                others += [type_name(use) for use in inner if _remaps_all(use, entry)]
                others += self._beside(name, Path(element.place.path))
            for one in others:
                if one not in found and one in self.trees:
                    found.append(one)
                    left.append(one)
        return found

    def _beside(self, name: str, path: Path) -> list[str]:
        """Return the trees over the blackboard of a mission's main tree: what it needs to start, and how it comes to rest."""
        document = self.documents.get(path)
        if document is None:
            return []
        main = document.root.get(MAIN)
        of_mission = [one for one in (main, READY, STOP_HERE) if one]
        return of_mission if main and name in of_mission else []

    def _subtree_uses(self, name: str) -> Iterator[tuple[str, Element]]:
        for tree, elements in self.trees.items():
            for element in elements:
                yield from ((tree, one) for one in element.iterate() if one.tag == SUBTREE and type_name(one) == name)

    def _as_port(self, name: str, entry: str) -> Iterator[Use]:
        """Yield an entry of a tree where it is a port: in the uses of the tree, and in its model."""
        for _, use in self._subtree_uses(name):
            if entry in use.attributes:
                yield Use(_span(use.attributes[entry].place, len(entry)))
                yield from _own_name(use.attributes[entry], entry)
        for document in self.documents.values():
            for model in (one for part in document.root.children if part.tag == MODELS for one in part.children):
                if model.tag == SUBTREE and model.get("ID") == name:
                    for port in (one for one in model.children if one.get("name") == entry):
                        yield Use(_span(port.attributes["name"].place_of(0), len(entry)), defining=True)


def _remaps_all(use: Element, entry: str) -> bool:
    """Return whether an entry of a subtree is the one of that name around it."""
    return use.get(AUTOREMAP).lower() in ON and entry not in use.attributes


def _own_name(attribute: Attribute, entry: str) -> Iterator[Use]:
    """Yield the value of a port that names the entry of the port's own name, which keeps its name in the other tree."""
    if attribute.value.strip(" ") in {"{=}", "="}:
        yield Use(_span(attribute.place_of(0), len(attribute.value)), text="{" + entry + "}")


def _span(place: Place, length: int, after: int = 0) -> Span:
    return Span(place.path, place.line, place.column + after, place.column + after + length)


def _ids(document: Document) -> Iterator[tuple[str, Use]]:
    """Yield the places of IDs of trees."""
    root = document.root
    if root.get(MAIN):
        yield root.get(MAIN), Use(_span(root.attributes[MAIN].place_of(0), len(root.get(MAIN))))
    for element in root.iterate():
        if element.tag in {TREE, SUBTREE} and element.get("ID"):
            yield element.get("ID"), Use(_span(element.attributes["ID"].place_of(0), len(element.get("ID"))), defining=element.tag == TREE)


def _nodes(document: Document) -> Iterator[tuple[str, Use]]:
    """Yield the places of types of node: in models, and as tags."""
    for part in document.root.children:
        if part.tag == MODELS:
            for model in part.children:
                if model.get("ID"):
                    yield model.get("ID"), Use(_span(model.attributes["ID"].place_of(0), len(model.get("ID"))), defining=True)
        elif part.tag == TREE:
            for node in (one for top in part.children for one in top.iterate()):
                yield node.tag, Use(_span(node.place, len(node.tag), after=1))


def _entries(tree: Element) -> Iterator[tuple[str, Use]]:
    """Yield the places of entries in a tree: in braces, and in scripts."""
    for element in (one for top in tree.children for one in top.iterate()):
        for attribute in element.attributes.values():
            key = pointer(attribute.value, attribute.name) if is_port(attribute.name) else None
            if key is not None:
                braced = attribute.value.strip(" ") not in {"{=}", "="}
                yield key, _braced(attribute, key) if braced else Use(_span(attribute.place_of(0), len(attribute.value)), text="{{}}")
            elif attribute.name in SCRIPTS:
                yield from _in_script(attribute)


def _braced(attribute: Attribute, key: str) -> Use:
    return Use(_span(attribute.place_of(attribute.value.index("{") + 1), len(key)))


def _in_script(attribute: Attribute) -> Sequence[tuple[str, Use]]:
    try:
        tokens = tokenize(attribute.value)
    except ScriptError:
        return []
    names = (one for one in tokens if one.kind is Kind.NAME and ENTRY.fullmatch(one.text))
    return [(one.text, Use(_span(attribute.place_of(one.offset), len(one.text)))) for one in names]
