"""Clouds of points: read from a PLY file, thinned, and packed for the page."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyParseError

MAX_POINTS = 30_000
CELL_M = 0.2
MAX_STEPS = 65_000

Floats = NDArray[np.float64]


class CloudError(Exception):
    """A file holds no cloud that can be read; the message names it and says why."""


class Packed(TypedDict):
    """Points as unsigned 16-bit numbers, base64: ``origin_m + step_m * number``; ``of`` is how many there are in the file."""

    count: int
    of: int
    origin_m: list[float]
    step_m: float
    data: str


def read_points(path: Path) -> Floats:
    """Return the finite vertices of a PLY file, (N, 3), metres.

    Raises:
        CloudError: it can't be read.
    """
    try:
        vertices = PlyData.read(str(path))["vertex"].data
        points = np.column_stack([np.asarray(vertices[axis], dtype=np.float64) for axis in "xyz"])
    except OSError as error:
        raise CloudError(f"{path.name}: {error.strerror}") from error
    except KeyError as error:
        raise CloudError(f"{path.name}: has no {error.args[0]}") from error
    except (PlyParseError, ValueError) as error:
        raise CloudError(f"{path.name}: {error}") from error
    return np.asarray(points[np.isfinite(points).all(axis=1)])


def thinned(points: Floats, limit: int = MAX_POINTS) -> Floats:
    """Return at most ``limit`` of the points, evenly in space: one a cell of 0.2 m, or of what else is needed."""
    cell_m, kept = CELL_M, points
    while len(kept) > limit:
        cells = np.floor((points - points.min(axis=0)) / cell_m).astype(np.int64)
        columns, rows, _ = cells.max(axis=0) + 1
        _, first = np.unique(cells[:, 0] + columns * (cells[:, 1] + rows * cells[:, 2]), return_index=True)
        kept = points[np.sort(first)]
        cell_m *= max(1.1, (len(kept) / limit) ** (1 / 3))
    return kept


def packed(points: Floats) -> Packed:
    """Pack points (N, 3), metres."""
    kept = thinned(points)
    origin = kept.min(axis=0) if len(kept) else np.zeros(3)
    span = float((kept.max(axis=0) - origin).max()) if len(kept) else 0.0
    step_m = max(0.01, span / MAX_STEPS)
    numbers = np.round((kept - origin) / step_m).astype("<u2")
    return Packed(
        count=len(kept),
        of=len(points),
        origin_m=[round(float(value), 3) for value in origin],
        step_m=step_m,
        data=base64.b64encode(numbers.tobytes()).decode("ascii"),
    )
