"""The floor as IR-SIM simulates it: the rover's body, walls, doors, the person; contacts, and what the laser sees."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

with contextlib.redirect_stdout(io.StringIO()):  # it tells of windows that it can't open
    import irsim
from rover_simulator.wheels import Pose
from rover_simulator.world import World

DOOR = "door_"


@dataclass(frozen=True)
class Sweep:
    """What the laser measures at once: ``ranges_m`` (N,) from ``angle_min_rad`` on; infinity where nothing is within reach."""

    ranges_m: NDArray[np.float64]
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float


class Floor:
    """IR-SIM, without a window, stepped by whoever has it."""

    def __init__(self, world: World, seed: int) -> None:
        self._env = irsim.make(str(world.path), headless=True, seed=seed, log_level="CRITICAL")
        self._rover = self._env.robot
        self._person = self._named("person")
        # The laser is stepped when a sweep is due, not with every tick: it takes most of the time.
        self._laser = self._rover.sensors.pop()
        # Its noise is drawn here: IR-SIM's generator is one for all simulations of a process.
        self._laser.noise, self._rng = False, np.random.default_rng([seed, 2])
        self.doors = {obj.name.removeprefix(DOOR): obj for obj in self._env.obstacle_list if obj.name.startswith(DOOR)}

    def _named(self, name: str) -> irsim.world.ObjectBase:
        return next(obj for obj in self._env.obstacle_list if obj.name == name)

    @property
    def period_s(self) -> float:
        """Length of a step."""
        return float(self._env.step_time)

    @property
    def pose(self) -> Pose:
        """The true pose of the rover."""
        x, y, yaw = (float(value) for value in self._rover.state[:3, 0])
        return x, y, yaw

    @property
    def person(self) -> tuple[float, float]:
        """Where the person is."""
        return float(self._person.state[0, 0]), float(self._person.state[1, 0])

    @property
    def touched(self) -> tuple[str, ...]:
        """Names of what the rover touches."""
        return tuple(sorted(other.name for other in self._rover.contact.partners))

    def step(self, rover: tuple[float, float], person: tuple[float, float]) -> None:
        """Move the rover at (v, w) and the person at (vx, vy) for a period; who meets something stays before it, or slides along it."""
        self._env.step([np.c_[list(rover)], np.c_[list(person)]], [self._rover.id, self._person.id])

    def carry(self, pose: Pose) -> None:
        """Put the rover somewhere else."""
        self._rover.set_state(list(pose))

    def put_person(self, place: tuple[float, float]) -> None:
        """Put the person somewhere else."""
        self._person.set_state([*place, 0.0])

    def open_door(self, name: str, *, wide: bool) -> None:
        """Open or shut a door at once."""
        self.doors[name].unobstructed = wide

    def sweep(self) -> Sweep:
        """Measure all around."""
        laser = self._laser
        laser.step(self._rover.state)
        noisy = laser.range_data + self._rng.normal(0.0, laser.std, laser.number)
        ranges = np.where(laser.valid, np.clip(noisy, laser.range_min, laser.range_max), np.inf)
        return Sweep(ranges, laser.angle_min, laser.angle_inc, laser.range_min, laser.range_max)
