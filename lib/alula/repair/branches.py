"""A branch that may be added to a mission: its nodes, its place, and the text of the file with it."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from textwrap import wrap

from alula.repair.subject import Subject, with_property, without_properties_of
from alula.trees.attributes import node_name
from alula.trees.document import Document, Element, quoted
from alula.trees.errors import Place

WIDTH = 140
STEP = "  "
HOLE = "Hole"
"""Where the node that a branch answers for stands in what is put around it."""
FALLBACKS = frozenset({"Fallback", "ReactiveFallback"})


class Rank(IntEnum):
    """The end that a branch leads to; branches with better ends are tried first."""

    GOES_ON = 0
    LEAVES_OUT = 1
    ENDS_WELL = 2
    GIVES_UP = 3


@dataclass(frozen=True)
class Branch:
    """A branch that may be added to a mission.

    Attributes:
        use: the node that is put into the mission: a use of a subtree, or what the node that it answers for is put into.
        tree: the node at the top of that subtree; None: the subtree is there already.
        at: the place of the node that it answers for.
        why: lines for a comment: for which situation it is, and why each step is there.
        wraps: the node stands in no Fallback yet, so that one is put around it.
        around: ``use`` is put around the node: in the place of its ``HOLE``, if it has nodes in it.
        rank: what it leads to.
    """

    use: Element
    tree: Element | None
    at: Place
    why: tuple[str, ...]
    wraps: bool = False
    around: bool = False
    rank: Rank = Rank.GOES_ON

    @property
    def size(self) -> int:
        """The number of its nodes."""
        use = sum(one.tag != HOLE for one in self.use.iterate()) if self.around or self.tree is None else 0
        return use + (0 if self.tree is None else sum(1 for _ in self.tree.iterate()))

    def within(self, most_nodes: int, *, shortest: bool = False) -> Branch | None:
        """Return the branch if it has at most ``most_nodes`` nodes, else with its script inside its condition; None: it is still too large.

        ``shortest``: with the script inside the condition in any case, as others share these nodes.
        """
        fits = self.size <= most_nodes
        if fits and not shortest:
            return self
        if self.tree is None or [one.tag for one in self.tree.children[:2]] != ["ScriptCondition", "Script"]:
            return self if fits else None
        top = clone(self.tree)
        condition, script = top.children[:2]
        condition.set("_onSuccess", script.get("code"))
        top.content.remove(script)
        shorter = replace(self, tree=top)
        return shorter if shorter.size <= most_nodes else None

    @property
    def order(self) -> tuple[int, int]:
        """The key of the order: the end that it leads to, then the number of its nodes."""
        return self.rank, self.size + self.wraps

    @property
    def key(self) -> tuple[str, ...]:
        """The key of its content: branches for different failures can be the same."""
        tree = "" if self.tree is None else "".join(self.tree.pieces())
        return "".join(self.use.pieces()), tree, str(self.at)

    @property
    def use_id(self) -> str:
        """The ID of its tree."""
        return next(one.get("ID") for one in self.use.iterate() if one.tag == "SubTree")

    @property
    def name(self) -> str:
        """The name of its node."""
        return node_name(self.use)

    def as_xml(self) -> str:
        """Return the XML to put into the file: its subtree, else the node that is put in."""
        use = list(_lines(self.use, 0)) if self.around or self.tree is None else []
        use[:0] = self._comment(WIDTH)
        return "\n".join([*use, *(_lines_of_tree(self) if self.tree is not None else [])])

    def comment_at(self, lead: str) -> list[str]:
        """Return the lines of the comment that it puts into the file, each behind ``lead``, a line break and an indentation."""
        return [f"{lead}{line}" for line in self._comment(WIDTH - len(lead) + 1)]

    def _comment(self, width: int) -> list[str]:
        """Return why a node is put in that has no tree of its own, which would say it."""
        if self.tree is not None or self.around:
            return []
        return comment_lines(" ".join(self.why), width)

    def written(self, subject: Subject, leave_out: tuple[str, ...] = (), more: str = "") -> tuple[str, list[str]]:
        """Return the text of the mission's file with it, and the properties that name these nodes and so are left out.

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
    """Return a copy that may be changed, of elements alone, without the text between them."""
    made = copy.deepcopy(element)
    for one in made.iterate():
        one.content = list(one.children)
    return made


def parent_of(root: Element, child: Element) -> Element:
    """Return the parent of an element."""
    return next(one for one in root.iterate() if any(part is child for part in one.content))


def at_place(document: Document, place: Place) -> Element:
    """Return the element that begins at a place in the file."""
    return next(one for one in document.root.iterate() if (one.place.line, one.place.column) == (place.line, place.column))


def _insert(document: Document, branch: Branch) -> None:
    """Put the branch behind the node that it answers for, in a Fallback; its tree goes behind the tree that this node stands in."""
    root = document.root
    element = at_place(document, branch.at)
    parent = parent_of(root, element)
    use = clone(branch.use)
    if branch.around:
        _put_around(parent, element, use if use.children else _with_hole(use))
    elif parent.tag in FALLBACKS:
        lead = _lead(parent, element)
        place = parent.content.index(element)
        parent.content[place + 1 : place + 1] = [*branch.comment_at(lead), lead, use]
    else:
        otherwise = {Rank.GIVES_UP: "give up", Rank.LEAVES_OUT: "not"}.get(branch.rank, node_name(use))
        lead = _lead(parent, element) + STEP
        outer = _wrap(parent, element, use, f"{node_name(element)}, or {otherwise}")
        place = outer.content.index(use) - 1
        outer.content[place:place] = branch.comment_at(lead)
    if branch.tree is not None:
        top = next(one for one in root.children if any(part is element for part in one.iterate()))
        text = f"\n\n{_indented(_lines_of_tree(branch), 1)}"
        place = root.content.index(top)
        root.content[place + 1 : place + 1] = [text]


def _wrap(parent: Element, element: Element, use: Element, name: str) -> Element:
    outer = node("Fallback", node(HOLE), use, name=name)
    _put_around(parent, element, outer)
    return outer


def _with_hole(use: Element) -> Element:
    use.content, use.empty = [node(HOLE)], False
    return use


def _put_around(parent: Element, element: Element, outer: Element) -> None:
    """Put an element into the hole of another one, which takes its place."""
    lead = _lead(parent, element)
    parent.content[parent.content.index(element)] = outer
    _lay_out(outer, element, lead)


def _lay_out(outer: Element, inner: Element, lead: str, depth: int = 1) -> None:
    """Give each node that is new a line of its own, and put another one into the hole, further indented."""
    content: list[Element | str] = []
    for child in outer.children:
        if child.tag == HOLE:
            content += [lead + STEP, inner]
            _shift(inner, STEP * depth)
        else:
            content += [lead + STEP, child]
            _lay_out(child, inner, lead + STEP, depth + 1)
    outer.content = [*content, lead] if content else outer.content


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


def tree_lines(name: str, top: Element) -> list[str]:
    """Return the lines of a tree as in a file, without its indentation."""
    return [f'<BehaviorTree ID="{name}">', *(STEP + one for one in _lines(top, 2)), "</BehaviorTree>"]


def comment_lines(text: str, width: int) -> list[str]:
    """Return the lines of a comment."""
    lines = wrap(_said(text), width - len("<!--  -->"))
    return [f"{'     ' if number else '<!-- '}{line}{' -->' if line is lines[-1] else ''}" for number, line in enumerate(lines)]


def _lines_of_tree(branch: Branch) -> list[str]:
    assert branch.tree is not None  # noqa: S101 - who asks has one
    return [*_comment(branch.why), *tree_lines(branch.use_id, branch.tree)]


def _comment(why: Sequence[str]) -> list[str]:
    """Return a comment of one line, if it fits there, else each sentence on its own."""
    whole = comment_lines(" ".join(why), WIDTH - len(STEP))
    if len(whole) <= 1:
        return whole
    return ["<!--", *(f"{STEP}{line}" for one in why for line in wrap(_said(one), WIDTH - 2 * len(STEP))), "-->"]


def _said(text: str) -> str:
    """Return what a comment of XML may say: names that authors give may have two hyphens side by side, a comment must not."""
    return re.sub("-(?=-)", "- ", text)


def _lines(element: Element, level: int) -> Iterator[str]:
    """Yield an element's lines, the longest broken before an attribute, as authors do."""
    if element.tag == HOLE:
        yield f"<!-- {element.get('name')} -->"
        return
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
