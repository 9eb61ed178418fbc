"""What a keyframe saw: in memory, or in a file where the keyframe lies behind."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from lidar_mapping.surface import Patches

if TYPE_CHECKING:
    from io import FileIO
    from pathlib import Path

    from numpy.typing import NDArray

Number = TypeVar("Number", np.float32, np.float64)
_POINT_BYTES = 3 * np.dtype(np.float32).itemsize


@dataclass(frozen=True)
class HeldSeen:
    """What a keyframe saw, in memory: ``points`` (N, 3) float32 and ``patches``, both in its base frame."""

    points: NDArray[np.float32]
    patches: Patches

    @property
    def count(self) -> int:
        """How many points there are."""
        return len(self.points)

    @property
    def nbytes(self) -> int:
        """What the arrays take of memory."""
        return self.points.nbytes + self.patches.points.nbytes + self.patches.normals.nbytes


class SeenFile:
    """A file without a name, in ``folder`` or the system's folder for temporary files; it is gone when this is. Not thread-safe."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._file: FileIO | None = None
        self._end = 0
        self.problem = ""
        """What has failed last, and what that means; empty as long as nothing has."""

    def put(self, seen: HeldSeen, *, at: int | None = None) -> HeldSeen | StoredSeen:
        """Store what was seen, ``at`` a place where more was stored before, or at the end; where that fails, return ``seen`` itself."""
        offset = self._end if at is None else at
        stored = StoredSeen(self, offset, seen.count, len(seen.patches.points))
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder, buffering=0)  # noqa: SIM115 -- open as long as this lives
            for content in (seen.points.tobytes(), seen.patches.points.tobytes(), seen.patches.normals.tobytes()):
                offset = _write(self._file.fileno(), content, offset)
        except OSError as error:
            self.problem = f"keyframes that lie behind stay in memory, which grows with the way: {error}"
            return seen
        self._end = max(self._end, offset)
        return stored

    def fill(self, array: NDArray[Number], offset: int) -> NDArray[Number]:
        """Read what is stored at ``offset`` into an array (N, 3) and return it; where it can't be read, return none of its rows."""
        try:
            assert self._file is not None  # noqa: S101 -- what is stored was put here
            _read(self._file.fileno(), array, offset)
        except OSError as error:
            self.problem = f"what a keyframe that lies behind saw is lost: {error}"
            return array[:0]
        return array


@dataclass(frozen=True)
class StoredSeen:
    """What a keyframe saw, in a file: each access reads it."""

    file: SeenFile
    offset: int
    count: int
    patch_count: int

    @property
    def points(self) -> NDArray[np.float32]:
        """Read the points."""
        return self.file.fill(np.empty((self.count, 3), dtype=np.float32), self.offset)

    @property
    def patches(self) -> Patches:
        """Read the patches."""
        both = self.file.fill(np.empty((2 * self.patch_count, 3)), self.offset + _POINT_BYTES * self.count)
        return Patches(both[: self.patch_count], both[self.patch_count :])


def _write(number: int, content: bytes, offset: int) -> int:
    """Write all of the content and return the offset behind it; raise OSError."""
    rest = memoryview(content)
    while rest:
        written = os.pwrite(number, rest, offset)
        rest, offset = rest[written:], offset + written
    return offset


def _read(number: int, array: NDArray[Number], offset: int) -> None:
    """Fill an array; raise OSError, also where the file is too short."""
    rest = array.reshape(-1).view(np.uint8).data
    while rest:
        count = os.preadv(number, [rest], offset)
        if not count:
            raise OSError(f"the file ends before byte {offset}")
        rest, offset = rest[count:], offset + count
