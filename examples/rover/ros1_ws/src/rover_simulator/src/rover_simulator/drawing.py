"""The map of a world, in map_server's format: what stands there for ever is occupied, doors are free."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import affinity

from rover_simulator.floor import DOOR
from rover_simulator.world import World, load_world

RESOLUTION_M = 0.05
MARGIN_M = 0.2
OCCUPIED, FREE = 0, 254  # grey values, as map_server reads them


def outlines(world: World) -> shapely.Geometry:
    """Return what stands there for ever."""
    shapes = []
    for obstacle in world.obstacles:
        if "kinematics" in obstacle or obstacle["name"].startswith(DOOR):
            continue
        x, y, yaw = obstacle["state"]
        shape = obstacle["shape"]
        if shape["name"] == "circle":
            shapes.append(shapely.Point(x, y).buffer(shape["radius"]))
        else:
            half_x, half_y = shape["length"] / 2.0, shape["width"] / 2.0
            shapes.append(affinity.rotate(shapely.box(x - half_x, y - half_y, x + half_x, y + half_y), yaw, use_radians=True))
    return shapely.union_all(shapes)


def draw(world: World) -> NDArray[np.uint8]:
    """Return the picture (H, W), its first row in the north: a cell is occupied where its middle is in something."""
    columns, rows = (round((size + 2.0 * MARGIN_M) / RESOLUTION_M) for size in world.size_m)
    x = (np.arange(columns) + 0.5) * RESOLUTION_M - MARGIN_M
    y = (np.arange(rows) + 0.5) * RESOLUTION_M - MARGIN_M
    inside = shapely.contains_xy(outlines(world), *np.meshgrid(x, y[::-1]))
    return np.where(inside, OCCUPIED, FREE).astype(np.uint8)


def write(world: World) -> None:
    """Write NAME_map.pgm and NAME_map.yaml beside the world."""
    picture = world.path.with_name(f"{world.path.stem}_map.pgm")
    pixels = draw(world)
    picture.write_bytes(b"P5\n%d %d\n255\n" % (pixels.shape[1], pixels.shape[0]) + pixels.tobytes())
    picture.with_suffix(".yaml").write_text(
        f"image: {picture.name}\nresolution: {RESOLUTION_M}\norigin: [{-MARGIN_M}, {-MARGIN_M}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        encoding="utf-8",
    )


def main() -> None:
    """Draw the map of the world that is named: draw_map WORLD.yaml."""
    write(load_world(Path(sys.argv[1])))
