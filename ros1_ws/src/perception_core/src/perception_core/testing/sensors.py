"""Synthetic measurements whose right answer is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

WIDTH, HEIGHT = 480, 270
DOWN_DEG = np.linspace(10.0, 80.0, 16)  # of the beams that meet the ground


def wall_pair(disparity_px: float, *, seed: int, wall: int = 7) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the left and right image (270, 480) of a textured ``wall`` square to the view; the noise alone depends on the seed."""
    texture = cv2.GaussianBlur(np.random.default_rng(wall).uniform(0, 255, (HEIGHT, WIDTH + 128)).astype(np.float32), (0, 0), 1.2)
    texture = (texture - texture.mean()) * 2.5 + 120.0
    shift = np.array([[1.0, 0.0, -disparity_px], [0.0, 1.0, 0.0]])
    moved = cv2.warpAffine(texture, shift, (WIDTH + 128, HEIGHT), flags=cv2.INTER_CUBIC)
    noise = np.random.default_rng(seed).normal(0.0, 1.5, (2, HEIGHT, WIDTH))
    left, right = (np.clip(image[:, :WIDTH] + grain, 0, 255).astype(np.uint8) for image, grain in ((texture, noise[0]), (moved, noise[1])))
    return left, right


def box_cloud(
    centre_m: tuple[float, float, float], *, seed: int, count: int = 60, ground_m: float = -2.0, noise_m: float = 0.02
) -> NDArray[np.float32]:
    """Return returns (N, 3) of a box 0.6 m wide at a place in the sensor's frame, of the ground below, and of the vehicle's own frame."""
    rng = np.random.default_rng(seed)
    box = np.array(centre_m) + rng.uniform(-0.3, 0.3, (count, 3))
    azimuth, down = (grid.ravel() for grid in np.meshgrid(np.radians(np.arange(360)), np.radians(DOWN_DEG)))
    away = -ground_m / np.tan(down)
    ground = np.column_stack([away * np.cos(azimuth), away * np.sin(azimuth), np.full(len(away), ground_m)])
    own = rng.uniform(-0.5, 0.5, (50, 3))
    points = np.vstack([box, ground, own])
    return (points + rng.normal(0.0, noise_m, points.shape)).astype(np.float32)
