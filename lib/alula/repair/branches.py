"""A branch that may be added to a mission: what it is made of, where it goes, and the file's text with it."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import wrap

from alula.repair.subject import Subject, with_property, without_properties_of
from alula.trees.document import Document, Element, quoted
from alula.trees.errors import Place
from alula.trees.reading import node_name

WIDTH = 140
STEP = "  "
FALLBACKS = frozenset({"Fallback", "ReactiveFallback"})


@dataclass(frozen=True)
class Branch:
    """A branch.

    Attributes:
        use: the node that is put into the mission: a use of a subtree, or what the node that it answers for is put into.
        tree: the node at the top of that subtree; None: the subtree is there already.
        at: the place of the node that it answers for.
        why: lines for a comment: for which situation it is, and why each step is there.
        wraps: the node stands in no Fallback yet, so that one is put around it.
        around: ``use`` is put around the node.
    """

    use: Element
    tree: Element | None
    at: Place
    why: tuple[str, ...]
    wraps: bool = False
    around: bool = False

    @property
    def size(self) -> int:
        """How many nodes it has."""
        return 1 if self.tree is None else sum(1 for _ in self.tree.iterate())

    @property
    def key(self) -> tuple[str, ...]:
        """What it is, whatever it is for."""
        tree = "" if self.tree is None else "".join(self.tree.pieces())
        return "".join(self.use.pieces()), tree, str(self.at)

    @property
    def name(self) -> str:
        """What it is called."""
        return node_name(self.use)

    def as_xml(self) -> str:
        """Return the subtree as it will stand in the file."""
        if self.around:
            return "\n".join(_lines(self.use, 0))
        return "" if self.tree is None else "\n".join(_lines_of_tree(self))

    def written(self, subject: Subject, leave_out: tuple[str, ...] = (), more: str = "") -> tuple[str, list[str]]:
        """Return the mission's file with it, and the properties that ask for nodes of these names, which are left out.

        ``more`` is a property that is asked besides.
        """
        document = subject.document()
        _insert(document, self)
        taken = without_properties_of(document.root, leave_out)
        with_property(document.root, subject.files.main, more)
        return document.text(), taken


def node(tag: str, *children: Element, **attributes: str) -> Element:
    """Return a new element; a dot in its tag is written ``__``, as in ``navigation__land``."""
    made = Element(tag.replace("__", "."), Place("", 0, 0), empty=not children)
    for name, value in attributes.items():
        made.set("if" if name == "if_" else name, value)
    made.content = list(children)
    return made


def clone(element: Element) -> Element:
    """Return a copy that may be changed, of nodes alone: what stands between them is laid out anew."""
    made = copy.deepcopy(element)
    for one in made.iterate():
        one.content = list(one.children)
    return made


def parent_of(root: Element, child: Element) -> Element:
    """Return the element that has another in it."""
    return next(one for one in root.iterate() if any(part is child for part in one.content))


def at_place(document: Document, place: Place) -> Element:
    """Return the element of a file that begins at a place."""
    return next(one for one in document.root.iterate() if (one.place.line, one.place.column) == (place.line, place.column))


def _insert(document: Document, branch: Branch) -> None:
    """Put the branch behind the node that it answers for, in a Fallback; its tree goes behind the tree that this node stands in."""
    root = document.root
    element = at_place(document, branch.at)
    parent = parent_of(root, element)
    use = clone(branch.use)
    if branch.around:
        _put_around(parent, element, use)
    elif parent.tag in FALLBACKS:
        lead = _lead(parent, element)
        place = parent.content.index(element)
        parent.content[place + 1 : place + 1] = [lead, use]
    else:
        _wrap(parent, element, use, f"{node_name(element)}, or else")
    if branch.tree is not None:
        top = next(one for one in root.children if any(part is element for part in one.iterate()))
        text = f"\n\n{_indented(_lines_of_tree(branch), 1)}"
        place = root.content.index(top)
        root.content[place + 1 : place + 1] = [text]


def _wrap(parent: Element, element: Element, use: Element, name: str) -> None:
    fallback = node("Fallback", name=name)
    _put_around(parent, element, fallback)
    fallback.content[2:2] = [fallback.content[0], use]


def _put_around(parent: Element, element: Element, outer: Element) -> None:
    lead = _lead(parent, element)
    place = parent.content.index(element)
    _shift(element, STEP)
    outer.empty = False
    outer.content = [lead + STEP, element, lead]
    parent.content[place] = outer


def _shift(element: Element, by: str) -> None:
    """Indent what stands in an element further."""
    for one in element.iterate():
        one.content = [part.replace("\n", f"\n{by}") if isinstance(part, str) else part for part in one.content]
        for attribute in one.attributes.values():
            attribute.lead = attribute.lead.replace("\n", f"\n{by}")


def _lead(parent: Element, element: Element) -> str:
    """Return the line break and the indentation before an element."""
    place = parent.content.index(element)
    before = parent.content[place - 1] if place else ""
    text = before if isinstance(before, str) else ""
    return "\n" + text.rpartition("\n")[2] if "\n" in text else "\n"


# --- layout -------------------------------------------------------------------------------------------------------------


def _lines_of_tree(branch: Branch) -> list[str]:
    assert branch.tree is not None  # noqa: S101 - who asks has one
    said = [f"{STEP}{line}" for one in branch.why for line in wrap(one, WIDTH - 2 * len(STEP))]
    comment = ["<!--", *said, "-->"] if said else []
    tree = [f'<BehaviorTree ID="{branch.use.get("ID")}">', *(STEP + one for one in _lines(branch.tree, 2)), "</BehaviorTree>"]
    return [*comment, *tree]


def _lines(element: Element, level: int) -> Iterator[str]:
    """Yield an element's lines, the longest broken before an attribute, as authors do."""
    words = [f"{one.name}={quoted(one.value)}" for one in element.attributes.values()]
    head = f"<{element.tag}"
    end = "/>" if not element.children else ">"
    room = WIDTH - len(STEP) * level
    line = head
    for number, word in enumerate(words):
        last = len(end) if number == len(words) - 1 else 0
        if len(line) + 1 + len(word) + last > room and line != head:
            yield line
            line = " " * len(head) + " " + word
        else:
            line += f" {word}"
    yield line + end
    for child in element.children:
        yield from (STEP + one for one in _lines(child, level + 1))
    if element.children:
        yield f"</{element.tag}>"


def _indented(lines: list[str], level: int) -> str:
    return "\n".join(STEP * level + one for one in lines)
