"""The pure parts of simulator and navigation together, without ROS: what the nodes do with each step, in their order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from alula import parts

from rover_navigation.geometry import compose, inverse, points_of
from rover_navigation.grid_map import load_map
from rover_navigation.health import BumperMonitor, LaserMonitor, PoseMonitor, WheelMonitor, WheelReading
from rover_navigation.jobs import Ended, Situation
from rover_navigation.matching import match
from rover_navigation.planning import RADIUS_M, Surroundings
from rover_simulator.person import Person
from rover_simulator.simulation import Simulation
from rover_simulator.world import load_world

WORLDS = Path(__file__).parents[4] / "worlds"


class Rig:
    def __init__(self, faults="", *, doors=("kitchen", "office", "workshop", "store", "side")):
        self.world = load_world(WORLDS / "office.yaml")
        self.grid = load_map(WORLDS / "office_map.yaml")
        self.simulation = Simulation(self.world, seed=1, faults=parts.parse_faults(faults))
        for door in doors:
            self.simulation.open_door(door, wide=True)
        self.around = Surroundings(self.grid)
        self.laser, self.status, self.wheels, self.bumper = LaserMonitor(), PoseMonitor(), WheelMonitor(), BumperMonitor()
        self.heard = []
        self._T_map_odom, self._points, self._scan_s, self._told = None, np.zeros((0, 2)), 0.0, 0.0
        for _ in range(6):
            self.step()

    @property
    def pose(self):
        return compose(self._T_map_odom, self.simulation.wheels.odometry)

    def stand(self, pose, *, person):
        """Put the rover and the person somewhere: the rover knows where it is, the person stays."""
        self.simulation.floor.carry(pose)
        self.simulation.floor.put_person(person)
        self.simulation.person = Person((person, person), person)
        self._T_map_odom = compose(pose, inverse(self.simulation.wheels.odometry))

    def step(self, job=None):
        """Step the simulation and a job; return how the job ended, or None."""
        simulation = self.simulation
        simulation.step()
        odom, now_s = simulation.wheels.odometry, simulation.now_s
        self._T_map_odom = self._T_map_odom or compose(self.world.dock, inverse(odom))
        if simulation.now_ns // 50_000_000 % 2 == 0 and (sweep := simulation.sweep()) is not None:
            self._scan(sweep, odom, now_s)
        pose = self.pose
        if self.laser.verdict(now_s) == "OK":
            self.wheels.step(WheelReading(now_s, odom[:2], pose[:2], self._told, simulation.wheels.odometry_speed[1]))
        self.bumper.step(odom[:2], pressed=simulation.bumper)
        self._hear(now_s)
        if job is None:
            return None
        done = job.step(Situation(now_s, pose, odom, self._points, now_s - self._scan_s, simulation.bumper, simulation.battery.charging))
        twist = (0.0, 0.0) if isinstance(done, Ended) else done
        simulation.wheels.command(*twist, now_s)
        self._told = twist[1]
        return done if isinstance(done, Ended) else None

    def run(self, job, limit_s=90.0):
        """Step until the job ends, or the time is over; return how it ended, or None."""
        end_s = self.simulation.now_s + limit_s
        while self.simulation.now_s < end_s:
            if (ended := self.step(job)) is not None:
                return ended
        return None

    def _scan(self, sweep, odom, now_s):
        self.laser.scan(sweep.ranges_m, now_s)
        if self.laser.repeats:
            return
        outside = np.where(sweep.ranges_m < RADIUS_M, np.inf, sweep.ranges_m)
        self._points, self._scan_s = points_of(outside, sweep.angle_min_rad, sweep.angle_step_rad), now_s
        found = match(self.grid, self.pose, self._points)
        self.status.quality(found.quality)
        if found.quality >= 0.5:
            self._T_map_odom = compose(found.pose, inverse(odom))
        misses = np.where(np.isinf(sweep.ranges_m), sweep.range_max_m, np.inf)
        self.around.look(self.pose, self._points, points_of(misses, sweep.angle_min_rad, sweep.angle_step_rad), now_s)

    def _hear(self, now_s):
        verdicts = (self.laser.verdict(now_s), self.status.verdict, self.wheels.verdict, self.bumper.verdict)
        self.heard += [verdict for verdict in verdicts if verdict not in {"", *self.heard}]
