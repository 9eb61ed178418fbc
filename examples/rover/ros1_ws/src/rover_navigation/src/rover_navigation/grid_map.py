"""The map: which cells are occupied, read from map_server's YAML and PGM."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import distance_transform_edt

from rover_navigation.geometry import Points


class MapError(Exception):
    """A map's file is wrong; the message names it."""


@dataclass(frozen=True)
class GridMap:
    """A map, its rows from south to north as nav_msgs/OccupancyGrid has them.

    Attributes:
        occupied: (H, W) bool.
        resolution_m: size of a cell.
        origin_m: the south-western corner of the first cell, frame map.
    """

    occupied: NDArray[np.bool_]
    resolution_m: float
    origin_m: tuple[float, float]

    @cached_property
    def distance_m(self) -> NDArray[np.float64]:
        """From the middle of each cell to the next occupied one."""
        return np.asarray(distance_transform_edt(~self.occupied)) * self.resolution_m

    def cells(self, points: Points) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return (rows, columns) of points in map; what is outside counts to the edge."""
        cells = np.floor((points - np.array(self.origin_m)) / self.resolution_m).astype(np.intp)
        rows, columns = self.occupied.shape
        return np.clip(cells[:, 1], 0, rows - 1), np.clip(cells[:, 0], 0, columns - 1)

    def middles(self, cells: NDArray[np.intp]) -> Points:
        """Return the middles of cells (N, 2), each row and column, in map."""
        return np.asarray((cells[:, ::-1] + 0.5) * self.resolution_m + np.array(self.origin_m), dtype=np.float64)


def load_map(path: Path) -> GridMap:
    """Read a map_server YAML and its picture; raises MapError. Only the mode ``trinary``; what is not occupied counts as free."""
    try:
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        with Image.open(path.with_name(said["image"])) as picture:
            grey = np.asarray(picture.convert("L"), dtype=np.float64) / 255.0
        occupancy = grey if said.get("negate") else 1.0 - grey
        x, y, _ = said["origin"]
        return GridMap(np.flipud(occupancy > said["occupied_thresh"]), float(said["resolution"]), (float(x), float(y)))
    except (OSError, KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise MapError(f"{path}: no map in map_server's format: {error}") from error
