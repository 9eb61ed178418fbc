"""The tree as it will stand: every use of a subtree with its own nodes and its own view of the blackboard."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

from alula.trees.document import Attribute, Element
from alula.trees.factory import SUBTREE
from alula.trees.node import Node, pointer
from alula.trees.palette import NodeType, Palette
from alula.trees.reading import AUTOREMAP, TreeFiles, is_port, node_name, type_name
from alula.trees.ticking import ANY_TICKING, Ticking

NodeClass: TypeAlias = type[Node]
Key = tuple[int, str]
"""An entry: the number of the blackboard that it stands on, and its name there."""


@dataclass(eq=False)
class Board:
    """The blackboard of one use of a tree; names that it does not have itself may be those of the board above."""

    number: int
    above: Board | None = None
    remapped: dict[str, str] = field(default_factory=dict)
    autoremap: bool = False

    def key(self, name: str) -> Key:
        """Return the entry that a name stands for."""
        if name.startswith("@"):
            return self.root.number, name[1:]
        if self.above is not None and name in self.remapped:
            return self.above.key(self.remapped[name])
        if self.above is not None and self.autoremap and not name.startswith("_"):
            return self.above.key(name)
        return self.number, name

    @property
    def root(self) -> Board:
        """The board of the main tree."""
        board = self
        while board.above is not None:
            board = board.above
        return board


@dataclass(eq=False)
class Site:
    """A node where it stands; ``children`` of a subtree's use is the top of that tree. ``type`` is None for an unknown node."""

    element: Element
    type: NodeType | None
    board: Board
    parent: Site | None = None
    children: list[Site] = field(default_factory=list)

    @property
    def name(self) -> str:
        """As the file calls it."""
        return node_name(self.element)

    @property
    def kind(self) -> str:
        """The name of its type; that of every subtree is SubTree."""
        return SUBTREE.name if self.is_subtree else type_name(self.element)

    @property
    def is_subtree(self) -> bool:
        """Whether it is the use of another tree."""
        return self.type is SUBTREE

    @cached_property
    def described(self) -> NodeClass | None:
        """The class that tells how it ticks its children and ends; None where nobody does, or where it has not the children for that."""
        known = self.type.described if self.type else None
        if known is None or self.type is None:
            return None
        least, most = self.type.children
        return known if least <= len(self.children) <= (len(self.children) if most is None else most) else None

    @cached_property
    def ticking(self) -> Ticking:
        """How it ticks its children."""
        return self.described.known_ticking() if self.described else ANY_TICKING

    @property
    def place(self) -> int:
        """The number among its parent's children."""
        return 0 if self.parent is None else self.parent.children.index(self)

    def given(self, port: str) -> str | None:
        """Return the text of a port, of the file or by default."""
        if port in self.element.attributes:
            return self.element.get(port)
        known = self.type.ports.get(port) if self.type else None
        return known.default if known else None

    def ports(self) -> Iterator[Attribute]:
        """Yield the attributes that are ports."""
        yield from (attribute for attribute in self.element.attributes.values() if is_port(attribute.name))

    def walk(self) -> Iterator[Site]:
        """Yield the node and all below it, in the order of the file."""
        left = [self]
        while left:
            site = left.pop()
            yield site
            left.extend(reversed(site.children))

    def above(self) -> Iterator[tuple[Site, Site]]:
        """Yield each node above with the child through which it is above, from here up."""
        site = self
        while site.parent is not None:
            yield site.parent, site
            site = site.parent


def expand(files: TreeFiles, palette: Palette, main: str) -> Site | None:
    """Return the main tree with its subtrees put in; None where it has no node. `structure.verify` has ruled out cycles and giants."""
    return _Expander(files, palette).tree(main)


class _Expander:
    def __init__(self, files: TreeFiles, palette: Palette) -> None:
        self._files = files
        self._palette = palette
        self._boards = 0

    def tree(self, main: str) -> Site | None:
        tops = self._files.trees[main].children
        return self._site(tops[0], Board(0), None) if tops else None

    def _site(self, element: Element, board: Board, parent: Site | None) -> Site:
        site = Site(element, SUBTREE if element.tag == SUBTREE.name else self._palette.get(type_name(element)), board, parent)
        if site.is_subtree:
            tree = self._files.trees.get(type_name(element))
            inner, below = (tree.children[:1] if tree else []), self._below(element, board)
        else:
            inner, below = element.children, board
        site.children = [self._site(child, below, site) for child in inner]
        return site

    def _below(self, element: Element, board: Board) -> Board:
        self._boards += 1
        pointers = {one.name: pointer(one.value, one.name) for one in element.attributes.values() if is_port(one.name)}
        remapped = {name: key for name, key in pointers.items() if key is not None}
        return Board(self._boards, board, remapped, element.get(AUTOREMAP).lower() in {"1", "true"})
