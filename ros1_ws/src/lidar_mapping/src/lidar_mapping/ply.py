"""Write a map as a binary PLY file, whole or not at all; read one back."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from plyfile import PlyData, PlyElement, PlyParseError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_VERTEX = np.dtype([(axis, "<f4") for axis in "xyz"])


def write_ply(path: Path, points: NDArray[np.float64]) -> None:
    """Write points (N, 3) aside and rename: a reader finds the old file or the new one. Raises OSError."""
    vertices = np.ascontiguousarray(points, dtype="<f4").view(_VERTEX)[:, 0]
    map_ = PlyData([PlyElement.describe(vertices, "vertex")], byte_order="<", comments=["frame map: ENU, metres"])
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with aside.open("wb") as file:
            map_.write(file)
            file.flush()
            os.fsync(file.fileno())
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def read_ply(path: Path) -> NDArray[np.float64]:
    """Return the vertices (N, 3) of a file; raise ValueError when it is no cloud of x, y and z, or is cut off."""
    try:
        vertices = PlyData.read(str(path))["vertex"].data
        return np.column_stack([np.asarray(vertices[axis], dtype=np.float64) for axis in "xyz"])
    except (PlyParseError, KeyError, ValueError) as error:
        raise ValueError(f"{path} is no map: {error}") from error
