"""Which entries of a mission's blackboards a tick looks at, or writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from alula.trees.blackboard import Entry

if TYPE_CHECKING:
    from _collections_abc import dict_items, dict_keys, dict_values

Place = tuple[int, str]
"""The number of a blackboard, and the name of an entry of its own."""


class Touched:
    """The entries that a tick has accessed: ``places``, each with the number of questions before; ``everything``: perhaps all entries."""

    def __init__(self, asked: Callable[[], int]) -> None:
        self.places: dict[Place, int] = {}
        self.everything = False
        self._asked = asked
        self._ticking = False

    def begin(self) -> None:
        """Begin a tick."""
        self.places, self.everything, self._ticking = {}, False, True

    def end(self) -> None:
        """End the tick: later accesses are not recorded."""
        self._ticking = False

    def one(self, place: Place) -> None:
        """Record an access to an entry, whether it exists or not."""
        if self._ticking and place not in self.places:
            self.places[place] = self._asked()

    def all(self) -> None:
        """Record that the tick may depend on any entry."""
        if self._ticking:
            self.everything = True


class TouchedEntries(dict[str, Entry]):
    """The entries of one blackboard; each access is recorded."""

    def __init__(self, number: int, touched: Touched) -> None:
        super().__init__()
        self._number = number
        self._touched = touched

    def __getitem__(self, key: str) -> Entry:
        """Return an entry."""
        self._touched.one((self._number, key))
        return super().__getitem__(key)

    def __setitem__(self, key: str, entry: Entry) -> None:
        """Have an entry."""
        self._touched.one((self._number, key))
        super().__setitem__(key, entry)

    def __contains__(self, key: object) -> bool:
        """Tell whether there is one."""
        self._touched.one((self._number, str(key)))
        return super().__contains__(key)

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, or the default."""
        self._touched.one((self._number, key))
        return super().get(key, default)

    def setdefault(self, key: str, default: Any = None) -> Any:
        """Return an entry, made if it is not there."""
        self._touched.one((self._number, key))
        return super().setdefault(key, default)

    def pop(self, key: str, *default: Any) -> Any:
        """Remove an entry, and return it."""
        self._touched.one((self._number, key))
        return super().pop(key, *default)

    def __iter__(self) -> Iterator[str]:
        """Yield all names."""
        self._touched.all()
        return super().__iter__()

    def __len__(self) -> int:
        """Return how many there are."""
        self._touched.all()
        return super().__len__()

    def keys(self) -> dict_keys[str, Entry]:
        """Return all names."""
        self._touched.all()
        return super().keys()

    def values(self) -> dict_values[str, Entry]:
        """Return all entries."""
        self._touched.all()
        return super().values()

    def items(self) -> dict_items[str, Entry]:
        """Return all names and entries."""
        self._touched.all()
        return super().items()
