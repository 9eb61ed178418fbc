"""A street and a wood, built at random, and what a LiDAR sees of them: of 64 rings 122,000 points a sweep; with true poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception_core import NS, PoseBuffer, Sweep
from uav_simulator.world.parts import Part, tree
from uav_simulator.world.scene import NO_HIT, Scene
from uav_simulator.world.shapes import Mesh, box, cylinder, rectangle

Floats = NDArray[np.float64]
Rng = np.random.Generator

RINGS_DEG = tuple(np.linspace(2.0, -24.8, 64).tolist())
COLUMNS = 2000
PERIOD_S = 0.1
RANGE_M = (1.0, 80.0)
NOISE_M = 0.02
HEIGHT_M = 1.8  # of the sensor, which is the middle of the vehicle here
SPEED_M_S = 8.0
SWAY_M = 1.0  # to either side, so that the car turns
SWAY_LENGTH_M = 60.0
ROAD_M, KERB_M = 4.5, 0.15
FACADE_M = 8.5


def in_the_way(along_m: float) -> Part:
    """Return a pillar of 0.6 m along x and 0.7 m across, so far along x in the middle of the way."""
    return Part("pillar", box((along_m - 0.3, -0.35, 0.0), (along_m + 0.3, 0.35, 2.6)), 0.5)


def street(length_m: float, seed: int, *others: Part) -> Scene:
    """Return a straight street along x from -80 m to its length and 80 m: facades with bays, parked cars, posts and trees on both sides."""
    rng = np.random.default_rng([seed, 17])
    begin, end = -80.0, length_m + 80.0
    parts = [Part("ground", rectangle((begin, end), (-60.0, 60.0)), 0.45)]
    for side in (1.0, -1.0):
        parts += [_across(box((begin, ROAD_M, 0.0), (end, FACADE_M, KERB_M)), side, "pavement")]
        parts += [_across(mesh, side, name) for name, mesh in (*_houses(begin, end, rng), *_kerbside(begin, end, rng))]
    return Scene([*parts, *others])


def wood(length_m: float, seed: int, *others: Part) -> Scene:
    """Return trees, posts and boxes on a plain, beside a way along x from -40 m to its length and 40 m that is 4 m wide."""
    rng = np.random.default_rng([seed, 18])
    parts = [Part("ground", rectangle((-80.0, length_m + 80.0), (-60.0, 60.0)), 0.45)]
    for along in np.arange(-40.0, length_m + 40.0, 2.5).tolist():
        for side in (1.0, -1.0):
            place = (along + rng.uniform(0.0, 2.0), side * rng.uniform(2.6, 14.0), 0.0)
            meshes = tree(rng), cylinder(0.1, 4.0), box((-0.6, -0.4, 0.0), (0.6, 0.4, rng.uniform(0.8, 2.5)))
            parts.append(Part("thing", meshes[int(rng.integers(len(meshes)))].moved(place), 0.5))
    return Scene([*parts, *others])


def _across(mesh: Mesh, side: float, name: str) -> Part:
    """Return a part that stands on one side of the street; a mirrored triangle is turned round to look outwards again."""
    if side > 0.0:
        return Part(name, mesh, 0.5)
    return Part(name, Mesh(mesh.vertices * [1.0, -1.0, 1.0], mesh.triangles[:, ::-1]), 0.5)


def _houses(begin: float, end: float, rng: Rng) -> list[tuple[str, Mesh]]:
    """Return facades of different depths and heights, with bays, and with alleys between some of them."""
    found, at = [], begin
    while at < end:
        width, back, height = rng.uniform(8.0, 18.0), rng.uniform(0.0, 2.0), rng.uniform(6.0, 14.0)
        found.append(("house", box((at, FACADE_M + back, 0.0), (at + width, FACADE_M + 12.0, height))))
        bays = np.arange(at + 1.5, at + width - 2.0, rng.uniform(2.5, 4.5))
        found += [("bay", box((bay, FACADE_M + back - 0.3, 1.0), (bay + 1.2, FACADE_M + back, height - 1.0))) for bay in bays.tolist()]
        at += width + (rng.uniform(3.0, 6.0) if rng.uniform() < 0.3 else 0.0)
    return found


def _kerbside(begin: float, end: float, rng: Rng) -> list[tuple[str, Mesh]]:
    """Return parked cars, posts and trees."""
    found, at = [], begin
    while at < end:
        at += rng.uniform(5.5, 16.0)
        body = box((at, ROAD_M - 2.1, 0.25), (at + 4.3, ROAD_M - 0.3, 0.9))
        found += [("car", body), ("cabin", box((at + 0.9, ROAD_M - 2.0, 0.9), (at + 3.4, ROAD_M - 0.4, 1.45)))]
        if rng.uniform() < 0.5:
            found.append(("post", cylinder(0.08, 5.0).moved((at + 5.0, ROAD_M + 0.5, 0.0))))
        elif rng.uniform() < 0.5:
            found.append(("tree", tree(rng).moved((at + 5.0, ROAD_M + 1.5, 0.0))))
    return found


@dataclass(frozen=True)
class Drive:
    """A drive along x, swaying: its sweeps, and the true poses (N, 4, 4) of the sensor at their ends."""

    scene: Scene
    seed: int
    speed_m_s: float = SPEED_M_S
    rings_deg: tuple[float, ...] = RINGS_DEG
    columns: int = COLUMNS
    sway_m: float = SWAY_M

    def pose(self, at_s: float) -> Floats:
        """Return T_map_lidar (4, 4) at a moment."""
        along, waves = self.speed_m_s * at_s, 2.0 * math.pi / SWAY_LENGTH_M
        slope = self.sway_m * waves * math.cos(waves * along)
        length = math.hypot(1.0, slope)
        c, s = 1.0 / length, slope / length
        pose = np.eye(4)
        pose[:2, :2], pose[:3, 3] = [[c, -s], [s, c]], (along, self.sway_m * math.sin(waves * along), HEIGHT_M)
        return pose

    def sweep(self, number: int) -> Sweep:
        """Return the sweep that ends at ``number`` periods after a second; each column is measured from the pose of its own moment."""
        begin_s = (number - 1) * PERIOD_S
        offsets_s = np.linspace(0.0, PERIOD_S, self.columns + 1)[1:]
        poses = np.array([self.pose(begin_s + offset_s) for offset_s in offsets_s])
        azimuth, up = np.linspace(np.pi, -np.pi, self.columns, endpoint=False), np.radians(self.rings_deg)
        directions = np.stack(
            np.broadcast_arrays(np.cos(up) * np.cos(azimuth)[:, None], np.cos(up) * np.sin(azimuth)[:, None], np.sin(up)), axis=-1
        )
        rays = np.empty((*directions.shape[:2], 6), dtype=np.float32)
        rays[..., :3] = poses[:, None, :3, 3]
        rays[..., 3:] = directions @ poses[:, :3, :3].transpose(0, 2, 1)
        hits = self.scene.cast(rays.reshape(-1, 6))
        rng = np.random.default_rng([self.seed, number])
        ranges = hits.range_m + rng.normal(0.0, NOISE_M, len(hits.range_m)).astype(np.float32)
        seen = np.flatnonzero((hits.triangle != NO_HIT) & (hits.range_m > RANGE_M[0]) & (hits.range_m < RANGE_M[1]))
        points = directions.reshape(-1, 3)[seen].astype(np.float32) * ranges[seen, None]
        stamp_ns = NS + round((number - 1) * PERIOD_S * NS)
        return Sweep(stamp_ns, points, offsets_s.astype(np.float32)[seen // len(up)])

    def poses(self, number: int, drift: float) -> PoseBuffer:
        """Return what an autopilot says around a sweep, whose position is too long by a share ``drift`` of the way."""
        buffer = PoseBuffer()
        for k in range(-2, 12):
            pose = self.pose((number - 1 + k / 10) * PERIOD_S)
            yaw = math.atan2(pose[1, 0], pose[0, 0])
            place = (1.0 + drift) * pose[:3, 3]
            stamp_ns = NS + round((number - 1 + k / 10) * PERIOD_S * NS)
            buffer.add(stamp_ns, (float(place[0]), float(place[1]), HEIGHT_M), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
        return buffer
