"""Files of trees: the one that is asked for, what it includes, and what they define together. Nothing is known of nodes here."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from alula.trees.document import Document, Element, parse_document, read_document
from alula.trees.errors import FileError, Problem, Report, did_you_mean, refuse
from alula.trees.palette import Category, Direction, NodeType, Palette, Port, node_type
from alula.trees.values import ANY, TYPES

FORMAT = "4"
MODELS = "TreeNodesModel"
PROJECT = ".btproj"
"""The end of a name of Groot2's projects: files that include others, and have no main tree."""
FORBIDDEN = re.compile(r"""[\x00-\x20\x7f<>&"'/\\:*?|.]""")
"""What the ID of a tree must not have in it since BehaviorTree.CPP 4.8.4."""
CATEGORIES = {category.value: category for category in Category}
DIRECTIONS = {**{direction.value: direction for direction in Direction}, "bidirectional_port": Direction.INOUT}
"""Of ports, also as Nav2's palette writes them."""
PRECONDITIONS = ("_failureIf", "_successIf", "_skipIf", "_while")
POSTCONDITIONS = ("_onHalted", "_onFailure", "_onSuccess", "_post")
AUTOREMAP = "_autoremap"
RESERVED = frozenset({"name", "ID", AUTOREMAP, *PRECONDITIONS, *POSTCONDITIONS})


def is_port(attribute: str) -> bool:
    """Tell whether an attribute of a node is a port: others are its name, conditions, or what an editor has noted (``_uid``)."""
    return attribute[0].isalpha() and attribute not in RESERVED


def type_name(element: Element) -> str:
    """Return the name of a node's type: the tag, or the ID of ``<Action ID=...>`` and its like."""
    return element.get("ID") if element.tag in CATEGORIES else element.tag


def node_name(element: Element) -> str:
    """Return the name of a node: that of its type unless it has one of its own."""
    return element.get("name") or type_name(element)


@dataclass
class TreeFiles:
    """What files define: ``trees`` are the elements <BehaviorTree> by ID, ``models`` the node types that a TreeNodesModel tells of.

    The first document is the one that was asked for. A tree that is defined twice is the last one, its own before an included one.
    """

    documents: list[Document] = field(default_factory=list)
    trees: dict[str, Element] = field(default_factory=dict)
    models: dict[str, NodeType] = field(default_factory=dict)
    main: str = ""

    @property
    def path(self) -> str:
        """Of the file that was asked for."""
        return self.documents[0].path

    def declared(self) -> Palette:
        """Return the types of node that a model tells of, without what makes them; subtrees are none."""
        return Palette(one for one in self.models.values() if one.category is not Category.SUBTREE)


def read_files(path: Path, report: Report = refuse) -> TreeFiles:
    """Read a file and what it includes.

    Raises:
        FileError: a file can't be read or is no XML; all else goes to ``report``.
    """
    files = TreeFiles()
    _Reader(files, report).add(read_document(path), (path.resolve(),))
    return _with_main(files, report)


def read_models(path: Path) -> Palette:
    """Return the types of node that a file tells of in its TreeNodesModel; it may have no trees. Raises FileError."""
    files = TreeFiles()
    _Reader(files, refuse).add(read_document(path), (path.resolve(),))
    return files.declared()


def read_text(text: str | bytes, path: str = "<text>", report: Report = refuse) -> TreeFiles:
    """Read the text of a file; what it includes is looked for beside ``path``. Raises as `read_files`."""
    files = TreeFiles()
    _Reader(files, report).add(parse_document(text, path), (Path(path).resolve(),))
    return _with_main(files, report)


def _with_main(files: TreeFiles, report: Report) -> TreeFiles:
    root = files.documents[0].root
    used = {type_name(one) for tree in files.trees.values() for one in tree.iterate() if one.tag == Category.SUBTREE.value}
    tops = [name for name in files.trees if name not in used]
    tops = [name for name in tops if files.trees[name].place.path == files.path] or tops
    is_one = len(tops) == 1 or (tops and files.path.endswith(PROJECT))
    files.main = root.get("main_tree_to_execute") or (tops[0] if is_one else "")
    _warn_of_names(files, report)
    if not files.trees:
        report(Problem(root.place, "has no <BehaviorTree>", "a file of missions needs one"))
    elif not files.main:
        report(Problem(root.place, "has several trees, and does not say which is the main one", 'add main_tree_to_execute="..."'))
    elif files.main not in files.trees:
        place = root.place_of("main_tree_to_execute")
        report(Problem(place, f"there is no tree '{files.main}'", did_you_mean(files.main, files.trees)))
    return files


def _warn_of_names(files: TreeFiles, report: Report) -> None:
    """Tell once of IDs of trees that newer versions refuse."""
    wrong = [(name, tree) for name, tree in files.trees.items() if FORBIDDEN.search(name)]
    if wrong:
        name, tree = wrong[0]
        more = f", and {len(wrong) - 1} more IDs of trees," if len(wrong) > 1 else ""
        message = f"'{name}'{more} {'have' if more else 'has'} a sign in it that BehaviorTree.CPP refuses there since 4.8.4"
        report(Problem(tree.place_of("ID"), message, "use letters, digits, `_` and `-`", "ALU621", warning=True))


class _Reader:
    """Adds documents to what was read; ``chain`` are the files that include one another down to here."""

    def __init__(self, files: TreeFiles, report: Report) -> None:
        self._files = files
        self._report = report
        self._seen: set[Path] = set()

    def add(self, document: Document, chain: tuple[Path, ...]) -> None:
        root = document.root
        self._files.documents.append(document)
        self._seen.add(chain[-1])
        for slip in document.slips:
            self._report(slip)
        if root.tag != "root":
            raise FileError(Problem(root.place, f"begins with <{root.tag}>", f'a file of trees has <root BTCPP_format="{FORMAT}">'))
        if root.get("BTCPP_format", FORMAT) != FORMAT:
            place, version = root.place_of("BTCPP_format"), root.get("BTCPP_format")
            self._report(Problem(place, f"is of BehaviorTree.CPP {version}", f"format {FORMAT} is read"))
        for element in root.children:
            if element.tag == "include":
                self._include(document, element, chain)
        for element in [one for one in root.children if one.tag == MODELS][1:]:
            self._report(
                Problem(element.place, f"a second <{MODELS}>", "put all models into one: BehaviorTree.CPP refuses a file with two")
            )
        for element in root.children:
            self._define(element, len([one for one in root.children if one.tag == "BehaviorTree"]))

    def _include(self, document: Document, element: Element, chain: tuple[Path, ...]) -> None:
        name = element.get("path")
        if not name:
            self._report(Problem(element.place, "<include> has no path", 'write <include path="other.xml"/>'))
            return
        if element.get("ros_pkg"):
            place = element.place_of("ros_pkg")
            self._report(Problem(place, "<include> names a ROS package", "give the path from this file on: trees know no ROS"))
            return
        path = Path(document.path).parent / name
        if path.resolve() in chain:
            self._report(Problem(element.place, f"{name} includes itself", "take one of the includes out", code="ALU007"))
        elif path.resolve() not in self._seen:
            if not path.is_file():
                self._report(Problem(element.place_of("path"), f"there is no file {path}", "the path counts from this file on"))
                return
            self.add(read_document(path), (*chain, path.resolve()))

    def _define(self, element: Element, trees: int) -> None:
        if element.tag == "BehaviorTree":
            name = element.get("ID")
            if not name and trees > 1:
                self._report(Problem(element.place, "<BehaviorTree> has no ID", "name it: the file has several"))
            if len(element.children) != 1:
                place = element.children[1].place if element.children else element.place
                self._report(Problem(place, f"the tree '{name}' has {len(element.children)} nodes at its top", "it needs one"))
            self._files.trees[name or f"BehaviorTree_{len(self._files.trees)}"] = element
        elif element.tag == MODELS:
            for model in _models(element, self._report):
                self._files.models[model.name] = model


def _models(element: Element, report: Report) -> Iterator[NodeType]:
    for one in element.children:
        category = CATEGORIES.get(one.tag)
        if category is None:
            continue  # editors keep there what they know besides
        if not one.get("ID"):
            report(Problem(one.place, f"<{one.tag}> without an ID is the model of no node", f'write <{one.tag} ID="...">'))
        else:
            ports = [_port(port) for port in one.children if port.tag in DIRECTIONS]
            yield node_type(one.get("ID"), category, ports)


def _port(element: Element) -> Port:
    default = element.get("default") if "default" in element.attributes else None
    doc = element.get("description") or "".join(part for part in element.content if isinstance(part, str)).strip()
    return Port(element.get("name"), TYPES.get(element.get("type"), ANY), DIRECTIONS[element.tag], default, doc)
