"""Flights of the simulator without ROS along the true route of a world: recorded once, followed by the SLAM as often as wanted.

As a program: `python3 lidar_mapping_flights.py --world yard --seeds 0-3 --kinds none,drift2` prints a row for each flight.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import open3d as o3d
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from lidar_mapping import ImuReading, Slam, SlamSettings
from lidar_mapping.readings import ReadingQueue
from perception_core import PoseBuffer, Sweep
from uav_simulator.autopilot.estimator import Estimator
from uav_simulator.autopilot.types import LandedState
from uav_simulator.flown import SimulatedAutopilotVehicle
from uav_simulator.imperfections import parse_imperfections
from uav_simulator.sensors.imu import Imu
from uav_simulator.sensors.mounts import LIDAR
from uav_simulator.simulation import TICK_NS, TICK_S, Simulation
from uav_simulator.world.config import find_world, load_world
from uav_simulator.world.parts import build_parts
from uav_simulator.world.scene import Scene

SPEED_M_S = 1.0
SWEEP_TICKS = 5
HOVER_TICKS = 50
TURN_TICKS = 150
KINDS = {"none": "off", "drift2": "position_drift=0.02", "drift5": "position_drift=0.05", "realistic": "realistic"}
T_BASE_LIDAR = np.eye(4)
T_BASE_LIDAR[:3, :3], T_BASE_LIDAR[:3, 3] = LIDAR.matrix, LIDAR.translation


@dataclass(frozen=True)
class Recording:
    """The truth of each tick (``body``, (N, 17): position, velocity, attitude w x y z, rates, specific force, on ground) and the sweeps.

    ``first`` is the tick at which the first sweep begins; sweep k ends ``SWEEP_TICKS`` * (k + 1) ticks later. ``clouds`` (M, 4) float32 are
    all points in the sensor's frame with their times, ``ends`` (S,) where each sweep's points end.
    """

    world: str
    seed: int
    body: np.ndarray
    first: int
    clouds: np.ndarray
    ends: np.ndarray

    def sweep(self, k, rng, noise_m) -> Sweep:
        """Return a sweep, its ranges noisier by ``noise_m``."""
        rows = self.clouds[(self.ends[k - 1] if k else 0) : self.ends[k]]
        points = rows[:, :3].astype(float)
        ranges = np.linalg.norm(points, axis=1, keepdims=True)
        points *= 1.0 + noise_m * rng.normal(size=ranges.shape) / ranges
        return Sweep((self.first + k * SWEEP_TICKS) * TICK_NS, points.astype(np.float32), rows[:, 3])

    def save(self, path) -> None:
        np.savez(path, body=self.body, first=self.first, clouds=self.clouds, ends=self.ends)


def load(path, world, seed) -> Recording:
    with np.load(path) as stored:
        return Recording(world, seed, stored["body"], int(stored["first"]), stored["clouds"], stored["ends"])


class Recorder:
    """Flies a world's route and keeps what happens."""

    def __init__(self, world, seed) -> None:
        self.config = load_world(find_world(world))
        self.simulation = Simulation(self.config, SimulatedAutopilotVehicle(seed=seed), seed=seed)
        self._mavlink = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)
        self._body, self._clouds, self._first = [], [], None
        self._note()

    def record(self, length_m) -> Recording:
        """Fly so many metres of the route and return what was recorded."""
        for command in ((176, 1, 4), (400, 1), (22, 0, 0, 0, 0, 0, 0, self.config.route[0][2])):
            self._send(mavlink.MAVLink_command_long_message(1, 1, command[0], 0, *command[1:], *[0] * (8 - len(command))))
        while self.simulation.flown.landed_state is not LandedState.IN_AIR:
            self._tick()
        self._first = self.simulation.now_ns // TICK_NS
        yaw, left_m = 0.0, length_m
        self._hold(self.config.route[0], yaw, HOVER_TICKS)
        for a, b in pairwise(np.array(self.config.route)):
            length = float(np.linalg.norm(b - a))
            if math.dist(a[:2], b[:2]) > 0.1:
                turned, yaw = yaw, math.atan2(b[1] - a[1], b[0] - a[0])
                self._hold(a, yaw, TURN_TICKS if turned != yaw else 0)
            for way in np.arange(0.0, min(length, left_m), SWEEP_TICKS * TICK_S * SPEED_M_S):
                self._hold(a + (b - a) * way / length, yaw, SWEEP_TICKS)
            left_m -= length
            if left_m <= 0.0:
                break
            self._hold(b, yaw, HOVER_TICKS)
        ends = np.cumsum([len(cloud) for cloud in self._clouds])
        return Recording(self.config.name, self.simulation.seed, np.array(self._body), self._first, np.vstack(self._clouds), ends)

    def _send(self, message) -> None:
        self.simulation.flown.endpoint.feed(message.pack(self._mavlink))

    def _hold(self, place, yaw, ticks) -> None:
        x, y, z = place
        args = (0, 1, 1, 1, 0x09F8, y, x, -z, 0, 0, 0, 0, 0, 0, math.pi / 2.0 - yaw, 0)
        self._send(mavlink.MAVLink_set_position_target_local_ned_message(*args))
        for _ in range(ticks):
            self._tick()

    def _tick(self) -> None:
        self.simulation.tick()
        self._note()
        tick = self.simulation.now_ns // TICK_NS
        if self._first is not None and tick > self._first and (tick - self._first) % SWEEP_TICKS == 0:
            seen = self.simulation.lidar.scan(self.simulation.track, (tick - SWEEP_TICKS) * TICK_S)
            self._clouds.append(np.column_stack([seen[name] for name in ("x", "y", "z", "time")]))

    def _note(self) -> None:
        body = self.simulation.flown.body
        self._body.append([*body.position, *body.velocity, *body.attitude, *body.rates, *body.specific_force, body.on_ground])


@dataclass(frozen=True)
class Following:
    """How a SLAM followed a recording; rows are sweeps, in the frame that the first sweep fixed.

    ``off_m`` (S, 3) is the position's error, ``turned_rad`` (S, 3) the attitude's about the body's axes, ``covariance`` (S, 6, 6) what was
    stated of both. ``map_rmse_m``: of the map's points to the true surfaces.
    """

    way_m: np.ndarray
    off_m: np.ndarray
    turned_rad: np.ndarray
    covariance: np.ndarray
    map_rmse_m: float
    cpu_s: np.ndarray
    slam: Slam

    @cached_property
    def distance_m(self) -> np.ndarray:
        return np.linalg.norm(self.off_m, axis=1)

    @cached_property
    def nees(self) -> np.ndarray:
        """The squared error of the position in units of the stated covariance, a direction."""
        return np.einsum("ni,nij,nj->n", self.off_m, np.linalg.inv(self.covariance[:, :3, :3]), self.off_m) / 3.0

    @cached_property
    def ratio(self) -> np.ndarray:
        """The squared error of the position in units of the stated variance."""
        return self.distance_m**2 / np.trace(self.covariance[:, :3, :3], axis1=1, axis2=2)

    @cached_property
    def sigma_m(self) -> np.ndarray:
        return np.sqrt(np.trace(self.covariance[:, :3, :3], axis1=1, axis2=2))

    @property
    def height_m(self) -> float:
        """The largest error of the height."""
        return float(np.abs(self.off_m[:, 2]).max())

    @property
    def tilt_deg(self) -> float:
        """The root mean square of the attitude's error but for the heading."""
        return math.degrees(math.sqrt(np.mean(np.sum(self.turned_rad[:, :2] ** 2, axis=1))))

    @property
    def heading(self) -> tuple[float, float]:
        """The root mean square of the heading's error, degrees, and the mean square in units of the stated variance."""
        squared = self.turned_rad[:, 2] ** 2
        return math.degrees(math.sqrt(squared.mean())), float(np.mean(squared / self.covariance[:, 5, 5]))

    def row(self) -> str:
        heading_deg, heading_nees = self.heading
        return (
            f"way {self.way_m[-1]:5.1f} end {self.distance_m[-1]:.3f} rms {np.sqrt(np.mean(self.distance_m**2)):.3f} "
            f"max {self.distance_m.max():.3f} height {self.height_m:.3f} tilt {self.tilt_deg:.2f} "
            f"sigma end {self.sigma_m[-1]:.3f} max {self.sigma_m.max():.3f} "
            f"nees {self.nees[5:].mean():5.2f} ratio {self.ratio[5:].mean():5.2f} heading {heading_deg:.2f} nees {heading_nees:5.2f} "
            f"map {self.map_rmse_m:.4f} loops {self.slam.loops} "
            f"rejected {self.slam.count.rejected} cpu {1e3 * self.cpu_s.mean():.0f} ms p95 {1e3 * np.percentile(self.cpu_s, 95):.0f}"
        )


def follow(recording, imperfections="off", settings=None) -> Following:
    """Let a SLAM follow a recording with these imperfections of the autopilot and the sensors."""
    given = parse_imperfections(imperfections)
    autopilot, readings, truth = _said(recording, given)
    slam, queue, rng = Slam(settings or SlamSettings()), ReadingQueue(), np.random.default_rng([recording.seed, 17])
    rows, way_m, last, fixed = [], 0.0, None, None
    heard = recording.first
    for k in range(len(recording.ends)):
        sweep = recording.sweep(k, rng, given.range_noise_m)
        while heard < len(readings) and readings[heard].stamp_ns <= sweep.end_ns + TICK_NS:
            queue.add(readings[heard], readings[heard].stamp_ns)
            heard += 1
        begun_s = time.process_time()
        slam.add(sweep, queue.take_until(sweep.end_ns), autopilot, T_BASE_LIDAR)
        spent_s = time.process_time() - begun_s
        state = slam._odometry.state
        there = truth.at([slam._odometry.filter.stamp_ns])
        fixed = fixed or Frame(there.rotation[0], there.position[0], state.rotation, state.position)
        rotation, position = fixed.turn @ there.rotation[0], fixed.place(there.position[0])
        way_m += 0.0 if last is None else math.dist(position, last)
        last = position
        turned = Rotation.from_matrix(state.rotation.T @ rotation).as_rotvec()
        rows.append((way_m, position - state.position, turned, slam.pose()[1], spent_s))
    way, off, turned, covariance, spent = (np.array(column) for column in zip(*rows, strict=True))
    return Following(way, off, turned, covariance, map_rmse_m(recording, fixed, slam.map.points), spent, slam)


class Frame:
    """Where the SLAM's map lies in the world: by position and heading of the first sweep."""

    def __init__(self, true_rotation, true_position, rotation, position) -> None:
        ahead, said = true_rotation[:, 0], rotation[:, 0]
        yaw = math.atan2(said[1], said[0]) - math.atan2(ahead[1], ahead[0])
        self.turn = Rotation.from_euler("z", yaw).as_matrix()
        self._from, self._to = true_position, position

    def place(self, world) -> np.ndarray:
        """Return world points (3,) or (N, 3) in the map."""
        return (world - self._from) @ self.turn.T + self._to

    def back(self, points) -> np.ndarray:
        """Return map points (N, 3) in the world."""
        return (points - self._to) @ self.turn + self._from


def _said(recording, given):
    """Return what the autopilot says and what the IMU reads at each tick, and the true poses."""
    estimator = Estimator(recording.seed, given)
    imu = Imu(recording.seed, gyro_bias_rad_s=given.gyro_bias_rad_s, accel_bias_m_s2=given.accel_bias_m_s2)
    said, truth, readings = PoseBuffer(keep_s=1e6), PoseBuffer(keep_s=1e6), []
    for tick, row in enumerate(recording.body):
        position, velocity, attitude, rates, force, on_ground = (part.tolist() for part in np.split(row, [3, 6, 10, 13, 16]))
        body = SimpleNamespace(position=position, velocity=velocity, attitude=attitude, rates=rates, on_ground=bool(on_ground[0]))
        estimate, reading = estimator.step(body, TICK_S), imu.measure(rates, force)
        stamp_ns = tick * TICK_NS
        said.add(stamp_ns, estimate.position, (*estimate.attitude[1:], estimate.attitude[0]))
        truth.add(stamp_ns, position, (*attitude[1:], attitude[0]))
        readings.append(ImuReading(stamp_ns, np.array(reading.rates), np.array(reading.specific_force)))
    return said, readings, truth


def map_rmse_m(recording, fixed, points) -> float:
    """Return the root mean square of the distance of the map's points to the true surfaces, in the frame that the first sweep fixed."""
    scene = Scene(build_parts(load_world(find_world(recording.world)), recording.seed))
    placed = o3d.core.Tensor(fixed.back(points).astype(np.float32))
    return float(np.sqrt(np.mean(scene._all.compute_distance(placed, nthreads=1).numpy() ** 2)))


def recorded(world, seed, length_m, cache) -> Recording:
    """Return a recording, from the cache's folder if it is there."""
    if cache is None:
        return Recorder(world, seed).record(length_m)
    path = Path(cache) / f"{world}-{seed}-{length_m:g}.npz"
    if not path.exists():
        Recorder(world, seed).record(length_m).save(path)
    return load(path, world, seed)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", default="yard")
    parser.add_argument("--seeds", default="0-3")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--length", type=float, default=37.0, help="metres of the route; inf for all of it")
    parser.add_argument("--cache", help="folder that keeps recordings")
    options = parser.parse_args()
    first, _, last = options.seeds.partition("-")
    for seed in range(int(first), int(last or first) + 1):
        recording = recorded(options.world, seed, options.length, options.cache)
        for kind in options.kinds.split(","):
            found = follow(recording, KINDS.get(kind, kind))
            sys.stdout.write(f"{options.world} {seed} {kind:9} {found.row()}\n")


if __name__ == "__main__":
    main()
