"""Write a triangle mesh as a binary PLY file (little endian, float vertices, uchar/int face lists)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

_VERTEX = np.dtype([(axis, "<f4") for axis in "xyz"])
_FACE = np.dtype([("vertex_indices", "<i4", (3,))])


def write_mesh(path: Path, vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> None:
    """Write the mesh aside and rename it, so that a reader never meets half a file."""
    elements = [
        PlyElement.describe(np.ascontiguousarray(vertices, dtype="<f4").view(_VERTEX)[:, 0], "vertex"),
        PlyElement.describe(triangles.astype("<i4").view(_FACE)[:, 0], "face"),
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(path.name + ".part")
    PlyData(elements, byte_order="<", comments=["true surfaces, frame map (ENU), metres"]).write(str(aside))
    aside.replace(path)
