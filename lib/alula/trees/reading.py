"""Files of trees: the one that is asked for, what it includes, and what it takes of a library. Nothing is known of nodes here."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from alula.trees.attributes import type_name
from alula.trees.document import Document, Element, parse_document, read_document
from alula.trees.errors import FileError, Problem, Report, did_you_mean, refuse
from alula.trees.format3 import FORMAT, modernised
from alula.trees.library import MODELS, PROJECT, Library, models_of
from alula.trees.node_type import Category, NodeType
from alula.trees.registry import NodeRegistry

FORBIDDEN = re.compile(r"""[\x00-\x20\x7f<>&"'/\\:*?|.]""")
"""What the ID of a tree must not have in it since BehaviorTree.CPP 4.8.4."""
LIBRARY = "library"
"""Of <root>: folders and files between semicolons, from the file on, whose trees it may use. BehaviorTree.CPP has no such thing."""


@dataclass
class TreeFiles:
    """What files define: ``trees`` are the elements <BehaviorTree> by ID, ``models`` the node types that a TreeNodesModel tells of.

    The first document is the one that was asked for. A tree that is defined twice is the last one, its own before an included one;
    of a library only those are here that the others use.
    """

    documents: list[Document] = field(default_factory=list)
    trees: dict[str, Element] = field(default_factory=dict)
    models: dict[str, NodeType] = field(default_factory=dict)
    main: str = ""
    """Empty where the file has several trees, and nothing says which is the main one."""
    tops: list[str] = field(default_factory=list)
    """Trees of the file that are a part of no other."""
    is_part: bool = False
    """Other files of the library use its main tree, and give it entries."""

    @property
    def path(self) -> str:
        """Of the file that was asked for."""
        return self.documents[0].path

    def trees_but(self, others: Collection[Path]) -> dict[str, Element]:
        """Return the trees without those that they take of a library's files, which are given by their resolved paths."""
        if not others:
            return self.trees
        own = {document.path for document in self.documents}
        return {name: tree for name, tree in self.trees.items() if tree.place.path in own or Path(tree.place.path).resolve() not in others}

    def declared(self) -> NodeRegistry:
        """Return the types of node that a model declares, without what makes them; subtrees are none."""
        return NodeRegistry(one for one in self.models.values() if one.category is not Category.SUBTREE)

    def uses(self, name: str) -> Iterator[Element]:
        """Yield the uses of subtrees in a tree."""
        yield from (one for top in self.trees[name].children for one in top.iterate() if one.tag == Category.SUBTREE.value)


def read_files(path: Path, report: Report = refuse, *, main: str = "", library: Library | None = None, whole: bool = True) -> TreeFiles:
    """Read a file, what it includes, and what it uses of a library.

    Args:
        path: the file.
        report: takes what is wrong.
        main: its main tree, instead of what it says itself.
        library: other files whose trees it may use, besides those of the library that it names.
        whole: it has a main tree; else that may be the business of the program that loads it.

    Raises:
        FileError: a file can't be read or is no XML; all else goes to ``report``.
    """
    library = library or Library()
    return _read(library.document(path), path, report, main, library, whole=whole)


def read_models(path: Path) -> NodeRegistry:
    """Return the types of node that a file declares in its TreeNodesModel; it may have no trees. Raises FileError."""
    files = TreeFiles()
    _Reader(files, refuse, Library()).add(modernised(read_document(path)), (path.resolve(),))
    return files.declared()


def read_text(
    text: str | bytes, path: str = "<text>", report: Report = refuse, *, main: str = "", library: Library | None = None, whole: bool = True
) -> TreeFiles:
    """Read the text of a file; what it includes is looked for beside ``path``. Takes and raises what `read_files` does."""
    return _read(modernised(parse_document(text, path)), Path(path), report, main, library or Library(), whole=whole)


def _read(document: Document, path: Path, report: Report, main: str, library: Library, *, whole: bool) -> TreeFiles:
    files = TreeFiles()
    named = document.root.get(LIBRARY)
    folders = [path.parent / part.strip() for part in named.split(";") if part.strip()]
    for folder in folders:
        if not folder.exists():
            report(Problem(document.root.place_of(LIBRARY), f"there is no folder {folder}", "the path counts from this file on"))
    if folders:
        library = library.extended(folder for folder in folders if folder.exists())
    _Reader(files, report, library).add(document, (path.resolve(),))
    own = list(files.trees)
    _take_used(files, library, report)
    used = {type_name(one) for name in files.trees for one in files.uses(name)}
    tops = [name for name in own if name not in used] or own
    tops = [name for name in tops if files.trees[name].place.path == files.path] or tops
    files.tops = [name for name in tops if name not in library.used] or tops
    is_one = len(files.tops) == 1 or (files.tops and files.path.endswith(PROJECT))
    files.main = main or document.root.get("main_tree_to_execute") or (files.tops[0] if is_one else "")
    files.is_part = bool(library.used.get(files.main, set()) - {path.resolve()})
    _warn_of_names(files, own, report)
    _verify_main(files, document.root, report, given=main, whole=whole)
    return files


def _take_used(files: TreeFiles, library: Library, report: Report) -> None:
    """Add what is used of a library, and what that uses; tell of a tree that several files define."""
    files.models = {**library.models, **files.models}
    left = list(files.trees)
    while left:
        for element in files.uses(left.pop()):
            name = type_name(element)
            if name not in files.trees and (found := library.tree(name, element.place.path)) is not None:
                files.trees[name] = found
                left.append(name)
            others = {Path(one.place.path).resolve(): one for one in library.trees.get(name, ())}
            if name in files.trees and len(others) > 1:
                first, *more = others.values()
                message = f"the tree '{name}' stands in {first.place}, too" + (f", and in {len(more) - 1} more" if more[1:] else "")
                cure = "keep one of them: a program that loads all files takes any"
                report(Problem(more[0].place_of("ID"), message, cure, "ALU622", warning=True))


def _verify_main(files: TreeFiles, root: Element, report: Report, *, given: str, whole: bool) -> None:
    if not files.trees:
        cure = "a file of missions needs one; models of nodes are for `--palette`"
        report(Problem(root.place, "has no <BehaviorTree>", cure, warning=not whole and bool(files.models)))
    elif not files.main:
        cure = f'add main_tree_to_execute="...", or choose with `--main`: {", ".join(files.tops)}'
        report(Problem(root.place, "has several trees, and does not say which is the main one", cure, warning=not whole))
    elif files.main not in files.trees:
        place = root.place if given else root.place_of("main_tree_to_execute")
        cure = did_you_mean(files.main, files.trees) or f"there are {', '.join(files.trees)}"
        report(Problem(place, f"there is no tree '{files.main}'", cure))


def _warn_of_names(files: TreeFiles, own: Iterable[str], report: Report) -> None:
    """Tell once of IDs of trees that newer versions refuse."""
    wrong = [(name, files.trees[name]) for name in own if FORBIDDEN.search(name)]
    if wrong:
        name, tree = wrong[0]
        more = f", and {len(wrong) - 1} more IDs of trees," if len(wrong) > 1 else ""
        message = f"'{name}'{more} {'have' if more else 'has'} a sign in it that BehaviorTree.CPP refuses there since 4.8.4"
        report(Problem(tree.place_of("ID"), message, "use letters, digits, `_` and `-`", "ALU621", warning=True))


class _Reader:
    """Adds documents to what was read; ``chain`` are the files that include one another down to here."""

    def __init__(self, files: TreeFiles, report: Report, library: Library) -> None:
        self._files = files
        self._report = report
        self._library = library
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
        path = Path(document.path).parent / name
        if package := element.get("ros_pkg"):
            folder = self._library.package(package, path)
            if folder is None:
                cure = f"name its folder: `--package {package}=DIR`, or source its workspace"
                self._report(Problem(element.place_of("ros_pkg"), f"there is no ROS package '{package}'", cure))
                return
            path = folder / name
        if path.resolve() in chain:
            self._report(Problem(element.place, f"{name} includes itself", "take one of the includes out", code="ALU007"))
        elif path.resolve() not in self._seen:
            if not path.is_file():
                cure = "the path counts from the package on" if element.get("ros_pkg") else "the path counts from this file on"
                self._report(Problem(element.place_of("path"), f"there is no file {path}", cure))
                return
            self.add(self._library.document(path), (*chain, path.resolve()))

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
            for model in models_of(element, self._report):
                self._files.models[model.name] = model
