"""The contents of the functional layer's bag: where the vehicle truly was, and the states of simulator and guidance."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from alula.common.faults import FaultChange
from alula.report.files import Problems, finite, mapping
from alula.report.observed import fault_changes
from uav_report.bag_rescue import BAG, usable_bag

TRUE_POSE = "/sim/true_pose"
SIM_STATE = "/sim/state"
GUIDANCE = "/uav_guidance/state"
TOLD = "/uav_guidance/told"
MAPPING = "/lidar_mapping/state"
HEALTH = {"/zed_depth/health": "zed", "/lidar_obstacles/health": "lidar"}
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4  # uav_msgs/GuidanceState.landed_state
TOLD_AGAIN_S = 10.0
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Track:
    """A path in time: ``t_s`` (N,) absolute seconds of mission clock, rising; ``position_enu_m`` (N, 3), frame map."""

    t_s: Floats
    position_enu_m: Floats

    def between(self, start_s: float, end_s: float) -> Track:
        """Return the part from start (included) to end (not included)."""
        inside = (self.t_s >= start_s) & (self.t_s < end_s)
        return Track(self.t_s[inside], self.position_enu_m[inside])

    def length_m(self) -> float:
        """Return the length of the path."""
        return float(np.linalg.norm(np.diff(self.position_enu_m, axis=0), axis=1).sum())

    def horizontal_speed_m_s(self) -> Floats:
        """Return the horizontal speed at each sample, (N,)."""
        if len(self.t_s) < 2:
            return np.zeros(len(self.t_s))
        velocity = np.gradient(self.position_enu_m[:, :2], self.t_s, axis=0)
        return np.asarray(np.linalg.norm(velocity, axis=1), dtype=np.float64)


@dataclass(frozen=True)
class SimulatorAccount:
    """The simulator's last state; None where it published none."""

    lift_off_s: float | None
    collisions: int | None
    min_clearance_m: float | None
    distance_m: float | None
    faults: tuple[FaultChange, ...]
    crash: str = ""


@dataclass(frozen=True)
class GuidanceAccount:
    """One state of the guidance: ``t_s`` absolute; reference idle, takeoff, position, heading, hover or land; ``height_m`` z in map."""

    t_s: float
    reference: str
    mode: str
    landed_state: int
    armed: bool = False
    height_m: float = 0.0

    @property
    def landing(self) -> bool:
        """Return whether the vehicle was on its way down to the ground."""
        return self.reference == "land" or self.mode == "LAND" or self.landed_state == LANDING

    @property
    def left(self) -> str:
        """Return the state of a vehicle that ends so, in words, where that is not on the ground with its motors off."""
        if self.landed_state in {IN_AIR, TAKING_OFF, LANDING}:
            return f"still in the air, in {self.mode}, at {self.height_m:.1f} m"
        return f"on the ground with its motors on, in {self.mode}" if self.armed and self.landed_state == ON_GROUND else ""


@dataclass(frozen=True)
class HealthChange:
    """A change of a watch's verdict on a sensor at ``t_s``, absolute; ``fault`` is one of uav_msgs/SensorHealth, empty when ``ok``."""

    t_s: float
    sensor: str
    ok: bool
    fault: str
    reason: str


@dataclass(frozen=True)
class Recording:
    """The bag, as far as a report needs it. ``estimate`` is the guidance's own idea of the path."""

    truth: Track | None = None
    estimate: Track | None = None
    simulator: SimulatorAccount | None = None
    guidance: tuple[GuidanceAccount, ...] = ()
    map_points: int | None = None
    health: tuple[HealthChange, ...] = ()
    told: tuple[tuple[float, str], ...] = ()
    """Texts of autopilot and guidance for people, ``who: words``, each with its absolute seconds; what comes again within 10 s once."""

    @property
    def last_s(self) -> float:
        """The last moment at which the bag has the vehicle's place or state; absolute seconds, -inf where it has none."""
        ends = [float(track.t_s[-1]) for track in (self.truth, self.estimate) if track is not None]
        return max([*ends, *(state.t_s for state in self.guidance[-1:])], default=-math.inf)

    @property
    def path(self) -> Track | None:
        """The true path, or the estimated one on a vehicle whose true path is not known."""
        return self.truth or self.estimate


class _Point(Protocol):
    x: float
    y: float
    z: float


@dataclass
class _Samples:
    t_s: list[float] = field(default_factory=list)
    position: list[tuple[float, float, float]] = field(default_factory=list)

    def add(self, t_s: float, point: _Point) -> None:
        self.t_s.append(t_s)
        self.position.append((point.x, point.y, point.z))

    def track(self) -> Track | None:
        """Return what was collected, in order, once per moment, finite; None if that is nothing."""
        if not self.t_s:
            return None
        t_s, first = np.unique(np.asarray(self.t_s, dtype=np.float64), return_index=True)
        position = np.asarray(self.position, dtype=np.float64)[first]
        good = np.isfinite(position).all(axis=1)
        return Track(t_s[good], position[good]) if good.any() else None


def read_recording(folder: Path, problems: Problems) -> Recording:
    """Read the run's bag, recovering it if it was cut off; what it lacks is None in the result."""
    bag = usable_bag(folder, problems)
    if bag is None:
        return Recording()
    truth, estimate = _Samples(), _Samples()
    guidance: list[GuidanceAccount] = []
    simulator: list[str] = []
    health: dict[str, list[HealthChange]] = {sensor: [] for sensor in HEALTH.values()}
    told: list[tuple[float, str]] = []
    map_points: int | None = None
    with bag, problems.survive(f"{BAG} could be read in part only"):
        for topic, message, received in bag.read_messages(topics=[TRUE_POSE, SIM_STATE, GUIDANCE, TOLD, MAPPING, *HEALTH]):
            if topic == TRUE_POSE:
                truth.add(message.header.stamp.to_sec(), message.pose.position)
            elif topic == GUIDANCE:
                t_s = message.header.stamp.to_sec()
                estimate.add(t_s, message.position_enu_m)
                place = message.position_enu_m
                said_of = (message.reference, message.mode, message.landed_state, message.armed, place.z)
                guidance.append(GuidanceAccount(t_s, *said_of))
            elif topic == TOLD:
                t_s = received.to_sec()
                if not any(text == message.data and t_s - at_s < TOLD_AGAIN_S for at_s, text in told):
                    told.append((t_s, message.data))
            elif topic == SIM_STATE:
                simulator.append(message.data)
            elif topic in HEALTH:
                said = HealthChange(message.header.stamp.to_sec(), HEALTH[topic], message.ok, message.fault, message.reason)
                if not health[said.sensor] or health[said.sensor][-1].fault != said.fault:
                    health[said.sensor].append(said)
            elif topic == MAPPING:
                map_points = int(message.points)
    return Recording(
        truth=truth.track(),
        estimate=estimate.track(),
        simulator=_simulator_account(simulator, problems),
        guidance=tuple(guidance),
        map_points=map_points,
        told=tuple(told),
        health=tuple(sorted((change for changes in health.values() for change in changes), key=lambda change: change.t_s)),
    )


def _simulator_account(texts: list[str], problems: Problems) -> SimulatorAccount | None:
    """Read the last state that is whole."""
    for text in reversed(texts):
        try:
            state = mapping(json.loads(text))
        except ValueError:
            problems.note(f"{SIM_STATE} held a message that is no JSON")
            continue
        collisions = finite(state.get("collisions"))
        return SimulatorAccount(
            lift_off_s=finite(state.get("lift_off_s")),
            collisions=None if collisions is None else int(collisions),
            min_clearance_m=finite(state.get("min_clearance_m")),
            distance_m=finite(state.get("distance_m")),
            faults=tuple(fault_changes(state.get("faults"))),
            crash=str(state.get("crash") or ""),
        )
    return None
