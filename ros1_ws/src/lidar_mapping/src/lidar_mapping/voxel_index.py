"""Which row of a table a voxel has: sorted keys, searched for many at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Ints = NDArray[np.int64]

_NEW = 1 << 12
_SHARE = 8


class VoxelIndex:
    """Rows by keys, 64-bit integers; 16 bytes a key.

    What is new goes into a short list of its own, which is merged into the long one when it is an eighth of that: putting keys in costs
    by their number, not by the map's size.
    """

    def __init__(self) -> None:
        empty: Ints = np.empty(0, dtype=np.int64)
        self._long, self._short = (empty, empty), (empty, empty)

    def rows(self, keys: Ints) -> Ints:
        """Return the row of each key (N,), -1 for those that are not there; keys in order are found several times as fast."""
        rows: Ints = np.full(len(keys), -1, dtype=np.int64)
        for known, their_rows in (self._long, self._short):
            if len(known):
                place = np.minimum(np.searchsorted(known, keys), len(known) - 1)
                there = known[place] == keys
                rows[there] = their_rows[place[there]]
        return rows

    def put(self, keys: Ints, rows: Ints) -> None:
        """Put in keys (N,) that are not there, each once."""
        self._short = _merged(self._short, (keys, rows))
        if len(self._short[0]) > max(_NEW, len(self._long[0]) // _SHARE):
            self._long, self._short = _merged(self._long, self._short), (keys[:0], rows[:0])


def _merged(one: tuple[Ints, Ints], other: tuple[Ints, Ints]) -> tuple[Ints, Ints]:
    keys, rows = (np.concatenate(parts) for parts in zip(one, other, strict=True))
    order = np.argsort(keys, kind="stable")  # merges what is sorted already
    return keys[order], rows[order]
