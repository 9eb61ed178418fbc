"""Flights that were never flown: the simulator's sensors along a world's route, without ROS, autopilot and guidance.

``./alula bench perception --rendered WORLD:SEED`` takes off, flies along the route as the missions do (straight legs, a stop and a turn at
each corner) and lands, with the errors of the simulator's estimator and sensors. So half an hour of good measurements takes minutes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from perception_bench.recordings import Recording
from perception_core import NS, Sweep, VehicleMotion
from uav_simulator import ros_messages
from uav_simulator.autopilot.estimator import Estimator
from uav_simulator.frames import Quat, Vec3, wrap_pi
from uav_simulator.imperfections import parse_imperfections
from uav_simulator.sensors.lidar import Lidar
from uav_simulator.sensors.mounts import LIDAR, ZED_LEFT, Mount
from uav_simulator.sensors.pose_track import Pose, PoseTrack
from uav_simulator.sensors.stereo import StereoPair as StereoRenderer
from uav_simulator.vehicle.noise import SlowNoise
from uav_simulator.vehicle.quaternion import from_yaw, multiply
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene
from zed_depth import StereoPair

TICK_S = 0.02
MEASURE_TICKS = 5
SPEED_M_S, CLIMB_M_S, ACCELERATION_M_S2, TURN_RAD_S = 1.5, 1.0, 1.0, math.radians(45.0)
STANDS_S = 2.0  # before the take-off and after the landing
SWAY_RAD = math.radians(1.0)
GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class RenderedMoment:
    """Where the vehicle truly is, how fast, and where its nose points."""

    position: Vec3
    velocity: Vec3
    yaw_rad: float
    on_ground: bool


@dataclass(frozen=True)
class Body:
    """What the simulator's estimator looks at."""

    position: Vec3
    velocity: Vec3
    attitude: Quat
    on_ground: bool
    rates: Vec3 = (0.0, 0.0, 0.0)


def flight(route: tuple[Vec3, ...]) -> Iterator[RenderedMoment]:
    """Yield the moments of a flight along a route, every 20 ms."""
    ground = (route[0][0], route[0][1], 0.0)
    landing = (route[-1][0], route[-1][1], 0.0)
    yaw = _bearing(route[0], route[1])
    yield from _standing(ground, yaw, STANDS_S)
    points = [ground, *route, landing]
    for start, end in pairwise(points):
        level = math.dist(start[:2], end[:2]) > 0.1
        if level:
            turn = wrap_pi(_bearing(start, end) - yaw)
            for k in range(int(abs(turn) / TURN_RAD_S / TICK_S)):
                yield RenderedMoment(start, (0.0, 0.0, 0.0), yaw + math.copysign(TURN_RAD_S * TICK_S * (k + 1), turn), on_ground=False)
            yaw += turn
        yield from _leg(start, end, yaw, SPEED_M_S if level else CLIMB_M_S)
    yield from _standing(landing, yaw, STANDS_S)


def _bearing(start: Vec3, end: Vec3) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _standing(place: Vec3, yaw: float, seconds: float) -> Iterator[RenderedMoment]:
    for _ in range(int(seconds / TICK_S)):
        yield RenderedMoment(place, (0.0, 0.0, 0.0), yaw, on_ground=True)


def _leg(start: Vec3, end: Vec3, yaw: float, speed_m_s: float) -> Iterator[RenderedMoment]:
    length = math.dist(start, end)
    way, speed = 0.0, 0.0
    while length - way > 0.005:
        braking = math.sqrt(2.0 * ACCELERATION_M_S2 * max(length - way, 0.0))
        speed = max(0.02, min(speed + ACCELERATION_M_S2 * TICK_S, speed_m_s, braking))
        way = min(length, way + speed * TICK_S)
        x, y, z = (a + (b - a) * way / length for a, b in zip(start, end, strict=True))
        vx, vy, vz = ((b - a) / length * speed for a, b in zip(start, end, strict=True))
        yield RenderedMoment((x, y, z), (vx, vy, vz), yaw, on_ground=False)


def render(world: str, seed: int, imperfections: str) -> Recording:
    """Return the measurements of one flight through a world."""
    config, errors = load_world(find_world(world)), parse_imperfections(imperfections)
    scene = Scene(build_parts(config, seed))
    stereo = StereoRenderer(scene, seed, noise=errors.pixel_noise, exposure=errors.exposure)
    lidar = Lidar(scene, seed, noise_m=errors.range_noise_m)
    estimator, track = Estimator(seed, errors), PoseTrack()
    sway = SlowNoise(sigma=SWAY_RAD, tau_s=0.7, limit=3.0 * SWAY_RAD, seed=f"sway {seed}")
    recording = Recording(f"{world}, seed {seed}, {imperfections}")
    recording.mounts = {mount.frame_id: _matrix(mount) for mount in (ZED_LEFT, LIDAR)}
    recording.infos = {side: ros_messages.camera_info(stereo.camera, right=side == "right", stamp_ns=0) for side in ("left", "right")}
    forward = 0.0
    for tick, moment in enumerate(flight(config.route), start=50):
        stamp_ns = tick * round(TICK_S * NS)
        roll, pitch, _ = (0.0, 0.0, 0.0) if moment.on_ground else sway.step(TICK_S)
        speed = math.hypot(*moment.velocity[:2])
        pitch += (speed - forward) / TICK_S / GRAVITY_M_S2  # it tilts to accelerate
        forward = speed
        body = Body(moment.position, moment.velocity, _attitude(roll, pitch, moment.yaw_rad), moment.on_ground)
        track.add(Pose(stamp_ns / NS, body.position, body.attitude))
        told = estimator.step(body, TICK_S)  # type: ignore[arg-type]  # it reads no more of a body than this
        w, x, y, z = told.attitude
        recording.poses.add(stamp_ns, told.position, (x, y, z, w))
        if tick % MEASURE_TICKS:
            continue
        recording.motions.append((stamp_ns, VehicleMotion(told.velocity)))
        recording.pairs.append(StereoPair(stamp_ns, *stereo.render(Pose(stamp_ns / NS, body.position, body.attitude))))
        points = lidar.scan(track, stamp_ns / NS - lidar.spec.period_s)
        start_ns = stamp_ns - round(lidar.spec.period_s * NS)
        recording.sweeps.append(Sweep(start_ns, np.column_stack([points[axis] for axis in "xyz"]), points["time"].copy()))
    return recording


def _attitude(roll: float, pitch: float, yaw: float) -> Quat:
    """Return the attitude (w x y z) of small angles of roll and pitch at a heading."""
    return multiply(from_yaw(yaw), (math.sqrt(1.0 - (roll**2 + pitch**2) / 4.0), roll / 2.0, pitch / 2.0, 0.0))


def _matrix(mount: Mount) -> NDArray[np.float64]:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = mount.matrix, mount.translation
    return transform
