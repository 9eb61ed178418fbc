"""What surfaces look like: noise of several grain sizes, fixed to the surface, the same for both eyes of the stereo pair.

Each triangle has a plane of texture coordinates in metres; triangles of one plane share them, so that a wall is not cut along
its diagonal. A grain that is finer than a pixel at some place is faded out there, for it would only flicker.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_simulator.world.scene import Scene

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Image = NDArray[np.uint8]
TILE = 1024
SUN = np.array([0.35, -0.55, 0.76])


@dataclass(frozen=True)
class Grain:
    """One layer of noise: metres per texel and contrast in grey values."""

    texel_m: float
    contrast: float


GRAINS = (Grain(0.025, 60.0), Grain(0.12, 50.0), Grain(0.7, 36.0))


@dataclass(frozen=True)
class SurfaceTable:
    """Per triangle: two texture axes (M, 3) and offsets (M,) in metres, mean grey value (M,)."""

    axis_u: Floats
    axis_v: Floats
    offset_u: Floats
    offset_v: Floats
    grey: Floats


def surface_table(world: Scene, seed: int) -> SurfaceTable:
    """Return texture planes and shades of a world's triangles."""
    n = world.normals
    upright = np.abs(n[:, 2]) < 0.9
    up = np.where(upright[:, None], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    across = np.cross(up, n)
    axis_u: Floats = (across / np.linalg.norm(across, axis=1, keepdims=True)).astype(np.float64)
    # The offset depends on the plane only, so triangles of one wall continue one another.
    plane = np.round(np.column_stack([n, world.plane_offsets]), 3) @ np.array([12.9898, 78.233, 37.719, 53.117])
    offset_u = np.modf(np.sin(plane + seed) * 43758.5453)[0] * 20.0
    offset_v = np.modf(np.sin(plane * 1.7 + seed) * 24634.6345)[0] * 20.0
    axis_v: Floats = np.cross(n, axis_u).astype(np.float64)
    light: Floats = 0.55 + 0.45 * np.clip(n @ SUN, 0.0, 1.0)
    return SurfaceTable(axis_u, axis_v, offset_u, offset_v, 255.0 * world.brightness * light)


def noise_tiles(seed: int) -> list[Image]:
    """Return one tile of soft noise per grain, (1025, 1025) uint8: its last row and column are its first ones, so that tiles join."""
    rng = np.random.default_rng([seed, 2])
    tiles = []
    for _ in GRAINS:
        raw = rng.normal(size=(TILE, TILE)).astype(np.float32)
        padded = cv2.copyMakeBorder(raw, 4, 4, 4, 4, cv2.BORDER_WRAP)
        soft = cv2.GaussianBlur(padded, (0, 0), 0.9)[4:-4, 4:-4]
        tile = np.clip(128.0 + 60.0 * soft / soft.std(), 0.0, 255.0).astype(np.uint8)
        tiles.append(np.asarray(cv2.copyMakeBorder(tile, 0, 1, 0, 1, cv2.BORDER_WRAP)))
    return tiles


def layer(tile: Image, u_m: Floats32, v_m: Floats32, grain: Grain, spread_m: Floats32) -> Floats32:
    """Look a layer of noise up at texture coordinates in metres, (H, W) float32 grey values, faded out where a pixel spreads over more."""
    grey: Floats32 = cv2.remap(tile, _texels(u_m, grain), _texels(v_m, grain), cv2.INTER_LINEAR).astype(np.float32)
    grey -= 128.0
    grey *= np.clip(2.0 - spread_m / (1.5 * grain.texel_m), 0.0, 1.0) * (grain.contrast / 128.0)
    return grey


def _texels(metres: Floats32, grain: Grain) -> Floats32:
    """Return coordinates within the tile: OpenCV's own way to repeat an image takes three times as long."""
    # Whole 32nds of a texel, as OpenCV interpolates: in float32, these are brought into the tile without an error.
    texels: Floats32 = np.rint(metres * (32.0 / grain.texel_m)) * np.float32(1.0 / 32.0)
    texels -= TILE * np.floor(texels * np.float32(1.0 / TILE))
    return texels
