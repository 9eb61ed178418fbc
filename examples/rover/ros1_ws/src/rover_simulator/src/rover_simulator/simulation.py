"""The whole simulation without ROS: the same seed and the same commands give the same drive. One step is 50 ms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from alula import parts

from rover_simulator.battery import Battery
from rover_simulator.faults import FaultBoard
from rover_simulator.floor import Floor, Sweep
from rover_simulator.person import Person
from rover_simulator.wheels import Wheels
from rover_simulator.world import World

DEPARTED_M = 0.05
CONTACT_M, CONTACT_RAD = 0.06, 0.2  # how well it has to stand on the dock to be charged
COVERED_M = 0.12  # range at which what covers half of the laser is seen
HARMLESS = ("dock",)  # touching it is no collision


@dataclass
class Truth:
    """What no node of the rover knows; for judging. Seconds of the simulated clock."""

    t_s: float = 0.0
    departed_s: float | None = None
    collisions: int = 0
    touched: list[str] = field(default_factory=list)
    distance_m: float = 0.0
    charging: bool = False
    doors_open: list[str] = field(default_factory=list)
    person: tuple[float, float] = (0.0, 0.0)
    faults: list[dict[str, Any]] = field(default_factory=list)


class Simulation:
    """Steps everything; the caller decides when, and asks for the measurements that it wants."""

    def __init__(self, world: World, *, seed: int, faults: Sequence[parts.FaultRequest] = ()) -> None:
        self._world = world
        self.floor = Floor(world, seed)
        self.wheels = Wheels(np.random.default_rng([seed, 1]))
        self.battery = Battery()
        self.person = Person(world.person_route, world.person_stays)
        self.faults = FaultBoard(faults)
        self.truth = Truth()
        self.now_ns = 0
        self._start = self.floor.pose
        self._open: set[str] = set()
        self._held: Sweep | None = None

    @property
    def now_s(self) -> float:
        """Simulated time."""
        return self.now_ns * 1e-9

    @property
    def bumper(self) -> bool:
        """What the bumper says."""
        return bool(self.floor.touched) or self.faults.lasts("bumper", "stuck")

    def step(self) -> None:
        """Advance by a period."""
        floor, fails = self.floor, self.faults.lasts
        self.now_ns += round(floor.period_s * 1e9)
        if ("pose", "lost") in self.faults.step(self.now_s, self.truth.departed_s):
            floor.carry((self._world.kidnapped[0], self._world.kidnapped[1], self._world.kidnapped[2]))
        speed = self.wheels.step(self.now_s, floor.period_s, slip=fails("wheels", "slip"), weak=fails("wheels", "weak"))
        before, touched = floor.pose, floor.touched
        floor.step(speed, self.person.velocity(floor.person, floor.pose, stays=fails("person", "stays")))
        self.battery.step(floor.period_s, speed[0], charging=self._on_dock(), drains=fails("battery", "drains"))
        self._note(math.dist(before[:2], floor.pose[:2]), touched)

    def sweep(self) -> Sweep | None:
        """Return what the laser publishes now; None: nothing."""
        if self.faults.lasts("laser", "dead"):
            return None
        if self._held is None or not self.faults.lasts("laser", "frozen"):
            self._held = self.floor.sweep()
        if not self.faults.lasts("laser", "covered"):
            return self._held
        ranges = self._held.ranges_m.copy()
        ranges[len(ranges) // 2 :] = COVERED_M  # the left half
        return replace(self._held, ranges_m=ranges)

    def open_door(self, name: str, *, wide: bool) -> str:
        """Open or shut a door; return why it can't be, or nothing."""
        if self.faults.lasts("door", name):
            return f"the door '{name}' does not answer"
        self.floor.open_door(name, wide=wide)
        self._open = self._open | {name} if wide else self._open - {name}
        return ""

    @property
    def state(self) -> dict[str, Any]:
        """The truth, as JSON has it."""
        return asdict(self.truth)

    def _on_dock(self) -> bool:
        x, y, yaw = self.floor.pose
        dock = self._world.dock
        return math.dist((x, y), dock[:2]) < CONTACT_M and abs(math.remainder(yaw - dock[2], math.tau)) < CONTACT_RAD

    def _note(self, way_m: float, touched_before: Sequence[str]) -> None:
        truth, floor = self.truth, self.floor
        truth.t_s, truth.distance_m = round(self.now_s, 3), truth.distance_m + way_m
        truth.collisions += sum(name not in touched_before and name not in HARMLESS for name in floor.touched)
        truth.touched, truth.charging, truth.person = list(floor.touched), self.battery.charging, floor.person
        truth.doors_open, truth.faults = sorted(self._open), [asdict(change) for change in self.faults.changes]
        if truth.departed_s is None and math.dist(floor.pose[:2], self._start[:2]) > DEPARTED_M:
            truth.departed_s = round(self.now_s, 3)
