"""Write a triangle mesh as a binary PLY file (little endian, float vertices, uchar/int face lists)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_HEADER = """ply
format binary_little_endian 1.0
comment true surfaces, frame map (ENU), metres
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def write_mesh(path: Path, vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> None:
    """Write the mesh aside and rename it, so that a reader never meets half a file."""
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"] = 3
    faces["index"] = triangles
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(path.name + ".part")
    with aside.open("wb") as file:
        file.write(_HEADER.format(vertices=len(vertices), faces=len(triangles)).encode("ascii"))
        file.write(vertices.astype("<f4").tobytes())
        file.write(faces.tobytes())
    aside.replace(path)
