"""The inspection camera: what the telepilot sees, in colour, 640 x 360 pixels, 90 degrees across.

Rays are cast at half the resolution; what they meet is drawn at the full one with the same grains that the stereo pair sees, tinted
by what the surface is: ground, facade with windows, vegetation, metal.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_simulator.sensors.mounts import CAMERA, rotation_matrix
from uav_simulator.sensors.pose_track import Pose
from uav_simulator.sensors.stereo import Pinhole
from uav_simulator.sensors.texture import Floats32, Grain, layer, noise_tiles, surface_table
from uav_simulator.world.scene import NO_HIT, Scene

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
        self._noise = [rng.normal(0.0, NOISE, shape).astype(np.float32)[..., None] for _ in range(NOISE_FRAMES)]
        self._count = 0
        cx, cy = camera.centre_px
        x, y = np.meshgrid(
            (np.arange(0, camera.width, 2) + 0.5 - cx) / camera.focal_px, (np.arange(0, camera.height, 2) + 0.5 - cy) / camera.focal_px
        )
        self._directions = np.stack([x, y, np.ones_like(x)], axis=-1)

    def render(self, pose: Pose) -> Image:
        """Return the picture, (height, width, 3) uint8 RGB."""
        r_map_body = rotation_matrix(pose.attitude)
        eye = (np.asarray(pose.position) + r_map_body @ np.asarray(CAMERA.translation)).astype(np.float32)
        directions = (self._directions @ (r_map_body @ CAMERA.matrix).T).astype(np.float32)
        rays = np.concatenate([np.broadcast_to(eye, directions.shape), directions], axis=-1)
        hits = self._world.cast(np.ascontiguousarray(rays))
        surface = np.where(hits.triangle == NO_HIT, len(self._table.grey), hits.triangle).astype(np.intp)
        depth = np.minimum(hits.range_m, FAR_M)
        return self._draw(surface, depth, eye[None, None] + depth[..., None] * directions)

    def _draw(self, surface: NDArray[np.intp], depth: Floats32, points: Floats32) -> Image:
        """Colour the points that the rays met, (h, w, 3) in map, at twice their resolution."""
        u, v = self._texture(surface, points)
        size = (self.camera.width, self.camera.height)
        colours = self._colours[surface]
        colours[self._windowed[surface] & _in_window(u, v)] = WINDOW_RGB
        colour = cv2.resize(colours, size, interpolation=cv2.INTER_NEAREST)
        wide_u, wide_v, far = (cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (u, v, depth))
        shade = np.zeros((size[1], size[0]), dtype=np.float32)
        for grain, tile in zip((FINE, COARSE), self._tiles, strict=False):
            shade += layer(tile, wide_u, wide_v, grain, far / self.camera.focal_px)
        self._count += 1
        picture = colour + shade[..., None] + self._noise[self._count % NOISE_FRAMES]
        return np.asarray(np.clip(picture, 0.0, 255.0), dtype=np.uint8)

    def _texture(self, surface: NDArray[np.intp], points: Floats32) -> tuple[Floats32, Floats32]:
        """Return the texture coordinates of the points in metres; the sky has none."""
        table, known = self._table, np.minimum(surface, len(self._table.grey) - 1)
        u = np.einsum("hwk,hwk->hw", table.axis_u.astype(np.float32)[known], points) + table.offset_u.astype(np.float32)[known]
        v = np.einsum("hwk,hwk->hw", table.axis_v.astype(np.float32)[known], points) + table.offset_v.astype(np.float32)[known]
        sky = surface == len(table.grey)
        return np.where(sky, np.float32(0.0), u), np.where(sky, np.float32(0.0), v)


def _colours(world: Scene, grey: Floats, seed: int) -> Floats32:
    """Return the mean colour of each triangle and, last, of the sky, (M + 1, 3): one tint for a plane and all that is parallel to it."""
    rng = np.random.default_rng([seed, 8])
    tints = TINTS_RGB[rng.permutation(len(TINTS_RGB))]
    which = np.abs(np.round(world.brightness * 97.0)).astype(np.intp) % len(tints)
    ground = (world.normals[:, 2] > 0.99) & (np.abs(world.plane_offsets) < 0.01)
    tinted = np.where(ground[:, None], np.array(GROUND_RGB), tints[which]) * grey[:, None]
    return np.concatenate([tinted, [SKY_RGB]]).astype(np.float32)


def _windowed(world: Scene) -> NDArray[np.bool_]:
    """Tell of each triangle, and of the sky, whether it is part of a wall large enough for windows, (M + 1,)."""
    corners = world.vertices[world.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)  # of both halves of a wall
    wall = (np.abs(world.normals[:, 2]) < 0.1) & (area > WINDOWED_M2)
    return np.append(wall, False)


def _in_window(u: Floats32, v: Floats32) -> NDArray[np.bool_]:
    return np.asarray((np.mod(u, WINDOW_EVERY_M[0]) < WINDOW_M[0]) & (np.mod(v, WINDOW_EVERY_M[1]) < WINDOW_M[1]))
