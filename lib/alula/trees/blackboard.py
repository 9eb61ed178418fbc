"""Blackboards as BehaviorTree.CPP has them: one a subtree, whose entries may be those of the tree above.

A name is looked for in the tree's own entries, then by its remapping, then (``_autoremap``, unless it begins with ``_``) by the same name
above; ``@name`` is an entry of the root. What a remapped name creates is created above. An entry has a type once something that has one
has written it, and keeps it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from alula.trees.errors import TickError
from alula.trees.values import ANY, DOUBLE, STRING, PortType, shown

Clock = Callable[[], int]
"""Mission clock in nanoseconds."""


class Entry:
    """A value (None: not written yet), its type, how often it was written, and when last."""

    __slots__ = ("sequence", "stamp_ns", "type", "value")

    def __init__(self, type_: PortType) -> None:
        self.value: object = None
        self.type = type_
        self.sequence = 0
        self.stamp_ns = 0


class Blackboard:
    """The entries of one tree; ``above``: that of the tree that it is a part of."""

    def __init__(self, clock: Clock, above: Blackboard | None = None) -> None:
        self.above = above
        self.autoremap = False
        self.remapped: dict[str, str] = {}
        self._clock = clock
        self._entries: dict[str, Entry] = {}

    @property
    def root(self) -> Blackboard:
        """The one of the whole tree."""
        board = self
        while board.above is not None:
            board = board.above
        return board

    def keys(self) -> list[str]:
        """Return the names of its own entries, not of those above."""
        return list(self._entries)

    def values(self) -> Mapping[str, object]:
        """Return its own entries that have a value."""
        # A list is made in one step: a viewer's thread asks, too, while the mission writes.
        return {name: entry.value for name, entry in list(self._entries.items()) if entry.value is not None}

    def entries(self) -> Mapping[str, Entry]:
        """Return its own entries by name."""
        return dict(self._entries)

    def recall(self, entries: Mapping[str, tuple[PortType, object]], held: dict[str, Entry] | None = None) -> None:
        """Have these entries of its own, types and values, and no others; each with a value counts as written once.

        ``held``: an empty dict that holds them from then on, and may tell what is looked at.
        """
        known, self._entries = self._entries, {} if held is None else held
        for key, (type_, value) in entries.items():
            entry = self._entries[key] = known.get(key) or Entry(type_)
            entry.type, entry.value, entry.sequence = type_, value, int(value is not None)

    def entry(self, key: str) -> Entry | None:
        """Return an entry, its own or one above; None when there is none."""
        board: Blackboard | None = self
        if key.startswith("@"):
            board, key = self.root, key[1:]
        while board is not None:
            known = board._entries.get(key)  # noqa: SLF001 - the same class
            if known is not None:
                return known
            step = board._outside(key)  # noqa: SLF001
            if step is None:
                return None
            board, key = step
        return None

    def where(self, key: str) -> tuple[Blackboard, str]:
        """Return the blackboard that an entry is or belongs on, and its name there."""
        board = self
        if key.startswith("@"):
            board, key = self.root, key[1:]
        while key not in board._entries:  # noqa: SLF001 - the same class
            step = board._outside(key)  # noqa: SLF001
            if step is None:
                break
            board, key = step
        return board, key

    def candidates(self, key: str) -> Iterator[tuple[Blackboard, str]]:
        """Yield where an entry may be, from here up: the first of these that there is, as long as nothing takes it away."""
        board = self
        if key.startswith("@"):
            board, key = self.root, key[1:]
        yield board, key
        while (step := board._outside(key)) is not None:  # noqa: SLF001 - the same class
            board, key = step
            yield board, key

    def get(self, key: str) -> object:
        """Return a value, None when there is none."""
        entry = self.entry(key)
        return None if entry is None else entry.value

    def create(self, key: str, type_: PortType = ANY) -> Entry:
        """Return an entry, made where its name belongs when it is not there; raises TickError when it is of another type."""
        board, key = self.where(key)
        entry = board._entries.setdefault(key, Entry(type_))  # noqa: SLF001
        if entry.type is not type_ and ANY not in {entry.type, type_}:
            raise TickError(f"the blackboard's entry '{key}' is a {entry.type.name}, and is to be a {type_.name}")
        return entry

    def set(self, key: str, value: object, type_: PortType = ANY) -> None:
        """Write an entry; raises TickError when it has another type, and the value is none of that."""
        if key.startswith("@"):
            self.root.set(key[1:], value, type_)
            return
        entry = self._entries.get(key)
        if entry is None:
            self._write(self.create(key, type_), value)
            return
        if entry.type is ANY:
            entry.type = type_
        elif entry.type is not type_:
            value = self._as(entry, key, value)
        self._write(entry, value)

    def assign(self, key: str, value: object, *, create: bool) -> None:
        """Write an entry as a script does: where it is, without giving it a type.

        Raises:
            KeyError: there is none, and it is not to be created.
            TickError: it has a type, and the value is none of that.
        """
        entry = self.entry(key)
        if entry is None:
            if not create:
                raise KeyError(key)
            entry = self.create(key)
        # A number is not held against the type, as in BehaviorTree.CPP: a port that reads it converts it.
        text_anew = isinstance(value, str) and not isinstance(entry.value, str)
        self._write(entry, self._as(entry, key, value) if text_anew else value)

    def unset(self, key: str) -> None:
        """Take an entry of its own away; one above stays."""
        self._entries.pop(key, None)

    def _outside(self, key: str) -> tuple[Blackboard, str] | None:
        if self.above is None:
            return None
        if key in self.remapped:
            name = self.remapped[key]
            return (self.above.root, name[1:]) if name.startswith("@") else (self.above, name)
        return (self.above, key) if self.autoremap and not key.startswith("_") else None

    def _write(self, entry: Entry, value: object) -> None:
        entry.value = value
        entry.sequence += 1
        entry.stamp_ns = self._clock()

    @staticmethod
    def _as(entry: Entry, key: str, value: object) -> object:
        if entry.type is STRING and not isinstance(value, str):
            raise TickError(f"the blackboard's entry '{key}' is text, and {shown(value)} is none")
        try:
            return entry.type.read(value)
        except ValueError as error:
            raise TickError(f"the blackboard's entry '{key}': {error}") from None


def type_of(value: object) -> PortType:
    """Return the type of a value that a script has made."""
    return STRING if isinstance(value, str) else DOUBLE if isinstance(value, int | float) else ANY
