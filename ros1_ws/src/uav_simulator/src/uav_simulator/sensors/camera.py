"""The inspection camera: what the telepilot sees, in colour, 640 x 360 pixels, 90 degrees across.

Rays are cast at half the resolution; what they meet is drawn at the full one with the same grains that the stereo pair sees, tinted
by what the surface is: ground, facade with windows, vegetation, metal.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_simulator.sensors.mounts import CAMERA, rotation_matrix
from uav_simulator.sensors.pose_track import Pose
from uav_simulator.sensors.stereo import Pinhole
from uav_simulator.sensors.texture import Floats32, Grain, layer, noise_tiles, surface_table
from uav_simulator.world.scene import Scene

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

INTRINSICS = Pinhole(width=640, height=360, focal_px=320.0, baseline_m=0.0)
FAR_M = 100.0
FINE, COARSE = Grain(0.02, 22.0), Grain(0.25, 26.0)
NOISE = 1.5  # grey values, standard deviation
NOISE_FRAMES = 8
SKY_RGB = (168.0, 196.0, 232.0)
GROUND_RGB = (0.86, 1.0, 0.72)
TINTS_RGB = np.array([(1.0, 0.80, 0.66), (1.0, 0.93, 0.80), (0.84, 0.92, 1.0), (0.95, 0.98, 0.92)])  # of what is built, by turns
WINDOW_M = (1.1, 1.4)  # width and height
WINDOW_EVERY_M = (3.0, 3.0)
WINDOW_RGB = (58.0, 74.0, 92.0)
WINDOWED_M2 = 12.0  # walls of less have none


class ColourCamera:
    """Renders what the camera sees from a pose."""

    def __init__(self, world: Scene, seed: int, camera: Pinhole = INTRINSICS) -> None:
        self.camera = camera
        self._world = world
        self._table = surface_table(world, seed)
        self._tiles = noise_tiles(seed + 1)
        self._colours = _colours(world, self._table.grey, seed)
        self._windowed = _windowed(world)
        rng = np.random.default_rng([seed, 7])
        shape = (camera.height, camera.width)
        self._noise = [rng.normal(0.0, NOISE, shape).astype(np.float32) for _ in range(NOISE_FRAMES)]
        self._count = 0
        cx, cy = camera.centre_px
        x, y = (np.arange(0, camera.width, 2) + 0.5 - cx) / camera.focal_px, (np.arange(0, camera.height, 2) + 0.5 - cy) / camera.focal_px
        self._x, self._y = x.astype(np.float32)[None, :], y.astype(np.float32)[:, None]

    def render(self, pose: Pose) -> Image:
        """Return the picture, (height, width, 3) uint8 RGB."""
        r_map_body = rotation_matrix(pose.attitude)
        r_map_camera = r_map_body @ CAMERA.matrix
        eye = np.asarray(pose.position) + r_map_body @ np.asarray(CAMERA.translation)
        rays = np.empty((self._y.size, self._x.size, 6), dtype=np.float32)
        for axis in range(3):  # numpy is several times as slow along rows of three
            rays[..., axis] = eye[axis]
            rays[..., 3 + axis] = self._along(r_map_camera[axis].astype(np.float32))
        hits = self._world.cast(rays)
        # The number of no hit, the greatest, becomes the sky's.
        surface = np.minimum(hits.triangle, np.uint32(len(self._table.grey))).astype(np.intp)
        depth = np.minimum(hits.range_m, np.float32(FAR_M))
        return self._draw(surface, depth, *self._texture(surface, depth, r_map_camera, eye))

    def _along(self, a: Floats32 | Sequence[Floats32]) -> Floats32:
        """Return the product of a vector in the camera's frame, one or one for each ray, with the rays' directions, (h, w)."""
        return a[0] * self._x + a[1] * self._y + a[2]

    def _draw(self, surface: NDArray[np.intp], depth: Floats32, u: Floats32, v: Floats32) -> Image:
        """Colour what the rays met, (h, w), at twice their resolution."""
        size = (self.camera.width, self.camera.height)
        window = np.take(self._windowed, surface) & _in_window(u, v)
        colour = np.where(window, len(self._colours[0]) - 1, surface)
        wide_u, wide_v, far = (cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (u, v, depth))
        self._count += 1
        shade = self._noise[self._count % NOISE_FRAMES].copy()
        far *= np.float32(1.0 / self.camera.focal_px)
        for grain, tile in zip((FINE, COARSE), self._tiles, strict=False):
            shade += layer(tile, wide_u, wide_v, grain, far)
        channels = [cv2.resize(np.take(each, colour), size, interpolation=cv2.INTER_NEAREST) for each in self._colours]
        return np.asarray(cv2.merge([np.clip(each + shade, 0.0, 255.0).astype(np.uint8) for each in channels]))

    def _texture(self, surface: NDArray[np.intp], depth: Floats32, r_map_camera: Floats, eye: Floats) -> tuple[Floats32, Floats32]:
        """Return the texture coordinates of what the rays met, in metres: the eye's, and by how much they grow along the ray."""
        t, sky = self._table, np.zeros((1, 4))  # the sky has none
        found = []
        for axis, offset in ((t.axis_u, t.offset_u), (t.axis_v, t.offset_v)):
            table = np.concatenate([np.column_stack([axis @ r_map_camera, axis @ eye + offset]), sky]).astype(np.float32)
            *direction, at_eye = (np.take(column, surface) for column in np.ascontiguousarray(table.T))
            found.append(at_eye + depth * self._along(direction))
        return found[0], found[1]


def _colours(world: Scene, grey: Floats, seed: int) -> Floats32:
    """Return the mean colour of each triangle and, last, of sky and window, (3, M + 2): one tint for all planes that are parallel."""
    rng = np.random.default_rng([seed, 8])
    tints = TINTS_RGB[rng.permutation(len(TINTS_RGB))]
    which = np.abs(np.round(world.brightness * 97.0)).astype(np.intp) % len(tints)
    ground = (world.normals[:, 2] > 0.99) & (np.abs(world.plane_offsets) < 0.01)
    tinted = np.where(ground[:, None], np.array(GROUND_RGB), tints[which]) * grey[:, None]
    return np.concatenate([tinted, [SKY_RGB, WINDOW_RGB]]).T.astype(np.float32)


def _windowed(world: Scene) -> NDArray[np.bool_]:
    """Tell of each triangle, and of the sky, whether it is part of a wall large enough for windows, (M + 1,)."""
    corners = world.vertices[world.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)  # of both halves of a wall
    wall = (np.abs(world.normals[:, 2]) < 0.1) & (area > WINDOWED_M2)
    return np.append(wall, False)


def _in_window(u: Floats32, v: Floats32) -> NDArray[np.bool_]:
    within = [
        each - np.floor(each * np.float32(1.0 / every)) * np.float32(every) < size
        for each, every, size in zip((u, v), WINDOW_EVERY_M, WINDOW_M, strict=True)
    ]
    return np.asarray(within[0] & within[1])
