"""Write a map as a binary PLY file, whole or not at all; read one back."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_HEADER = """ply
format binary_little_endian 1.0
comment frame map: ENU, metres
element vertex {count}
property float x
property float y
property float z
end_header
"""


def write_ply(path: Path, points: NDArray[np.float64]) -> None:
    """Write points (N, 3) aside and rename: a reader finds the old file or the new one. Raises OSError."""
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with aside.open("wb") as file:
            file.write(_HEADER.format(count=len(points)).encode("ascii"))
            file.write(np.ascontiguousarray(points, dtype="<f4").tobytes())
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def read_ply(path: Path) -> NDArray[np.float64]:
    """Return the points (N, 3) of a file that ``write_ply`` wrote; raise ValueError for any other."""
    header, found, body = path.read_bytes().partition(b"end_header\n")
    count = next((int(line.split()[2]) for line in header.splitlines() if line.startswith(b"element vertex ")), -1)
    expected = _HEADER.format(count=count).encode("ascii")
    if not found or header + found != expected or len(body) != 12 * count:
        raise ValueError(f"{path} is not a map of ours: expected {count} points of x, y, z float32, got {len(body)} bytes")
    return np.frombuffer(body, dtype="<f4").reshape(count, 3).astype(np.float64)
