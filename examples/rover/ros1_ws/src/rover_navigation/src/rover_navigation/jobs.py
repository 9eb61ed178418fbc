"""What the navigation can do, each a job that is stepped with every odometry: drive, follow a corridor, creep, dock. No ROS."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from rover_navigation.following import LOOK_S, STAND, Twist, carrots, free_m, steer, towards, turn
from rover_navigation.geometry import Points, Pose, inverse, transformed, wrapped
from rover_navigation.planning import NoWayError, Surroundings, plan, plan_anew

ARRIVED_M, ARRIVED_RAD = 0.12, 0.1
SPEED_M_S, CREEP_M_S, DOCK_M_S = 0.5, 0.15, 0.1
REPLAN_S = 1.0
PATIENCE_S = 15.0  # without getting nearer
PROGRESS_M = 0.15
BLIND_S = 0.5  # without a scan nothing is driven that needs one
BACK_M, BACK_M_S = 0.2, 0.1  # creeping: away from what was touched
BEFORE_DOCK_M = 0.6  # where docking by scan begins
FACE_M = 0.25  # around where the dock should be its face is looked for
GAP_M = 0.27  # from the laser to the dock's face when it stands on the dock
CONTACT_S = 3.0
ASIDE_RAD = tuple(0.3 * step for step in (0, 1, -1, 2, -2, 3, -3, 4, -4))  # along a corridor: ways around what stands in it
ASIDE_M = 0.3  # of free way is worth less than going straight, for each radian aside


@dataclass(frozen=True)
class Situation:
    """What a job is stepped with: poses in map and in odom, the last scan in base_link and its age, bumper and charger."""

    now_s: float
    pose: Pose
    odom: Pose
    points: Points
    scan_age_s: float
    bumped: bool
    charging: bool


@dataclass(frozen=True)
class Ended:
    """How a job ended."""

    arrived: bool
    text: str


class Job(Protocol):
    """Something that moves the rover."""

    def step(self, now: Situation) -> Twist | Ended:
        """Return what the wheels are to do now, or how it ended."""


@dataclass
class Patience:
    """Ends when the rover has come no nearer for too long."""

    nearest_m: float = math.inf
    since_s: float = math.inf

    def out(self, distance_m: float, now_s: float) -> bool:
        """Note how far it still is; return whether that has not changed for too long."""
        if distance_m < self.nearest_m - PROGRESS_M or math.isinf(self.since_s):
            self.nearest_m, self.since_s = distance_m, now_s
        return now_s - self.since_s > PATIENCE_S


@dataclass
class Drive:
    """Drive to a pose: plan, follow, plan again; at last turn as the goal says. ``laser``: around what the laser sees."""

    around: Surroundings
    goal: Pose
    laser: bool = True
    speed_m_s: float = SPEED_M_S
    way: Points | None = None
    planned_s: float = -math.inf
    patience: Patience = field(default_factory=Patience)
    no_way: str = ""

    def step(self, now: Situation) -> Twist | Ended:
        """Drive on."""
        if self.laser and now.scan_age_s > BLIND_S:
            return Ended(arrived=False, text=f"no scan for {now.scan_age_s:.1f} s")
        distance = math.dist(now.pose[:2], self.goal[:2])
        if distance < ARRIVED_M:
            angle = wrapped(self.goal[2] - now.pose[2])
            return turn(angle) if abs(angle) > ARRIVED_RAD else Ended(arrived=True, text="arrived")
        if now.now_s - self.planned_s >= REPLAN_S:
            self._plan(now)
        if self.patience.out(self._rest_m(now.pose), now.now_s):
            return Ended(arrived=False, text=self.no_way or f"something stays in the way, {distance:.1f} m before the goal")
        if self.way is None:
            return STAND
        goals = carrots(self.way, now.pose)
        return steer(goals, self.speed_m_s, now.points) if self.laser else towards(goals[0], self.speed_m_s)

    def _plan(self, now: Situation) -> None:
        self.planned_s = now.now_s
        try:
            if self.laser:
                self.way = plan_anew(self.around, now.pose, self.goal, now.now_s)
            else:
                self.way = plan(self.around, now.pose, self.goal, seen=False)
            self.no_way = ""
        except NoWayError as error:
            self.way, self.no_way = None, str(error)

    def _rest_m(self, pose: Pose) -> float:
        """Return how long the way still is; infinity: there is none."""
        if self.way is None:
            return math.inf
        nearest = int(np.argmin(np.linalg.norm(self.way - np.array(pose[:2]), axis=1)))
        return float(np.linalg.norm(np.diff(self.way[nearest:], axis=0), axis=1).sum())


@dataclass
class Corridor:
    """Keep to the middle between two walls, and around who stands there, until the goal is beside the rover.

    The pose only says how far that is.
    """

    goal: Pose
    patience: Patience = field(default_factory=Patience)

    def step(self, now: Situation) -> Twist | Ended:
        """Drive on."""
        if now.scan_age_s > BLIND_S:
            return Ended(arrived=False, text=f"no scan for {now.scan_age_s:.1f} s")
        to_go = transformed(inverse(now.pose), np.array([self.goal[:2]]))[0]
        if math.hypot(*to_go) < ARRIVED_M or (abs(math.atan2(to_go[1], to_go[0])) > math.pi / 2.0 and math.hypot(*to_go) < 1.0):
            return Ended(arrived=True, text="arrived")
        if self.patience.out(float(math.hypot(*to_go)), now.now_s):
            return Ended(arrived=False, text="something stays in the corridor")
        bearing = math.atan2(to_go[1], to_go[0])
        along = transformed((0.0, 0.0, -bearing), now.points)
        ahead = math.atan2(self._middle_m(along), 1.0)
        aside = max(ASIDE_RAD, key=lambda one: self._worth_m(along, ahead + one, one))
        heading = bearing + ahead + aside
        return steer(np.array([[math.cos(heading), math.sin(heading)]]), SPEED_M_S, now.points)

    @staticmethod
    def _worth_m(points: Points, heading_rad: float, aside_rad: float) -> float:
        """Return how far it gets straight on after a turn, less what going aside costs."""
        free = free_m((SPEED_M_S, 0.0), transformed((0.0, 0.0, -heading_rad), points))
        return min(free, SPEED_M_S * LOOK_S) - ASIDE_M * abs(aside_rad)

    @staticmethod
    def _middle_m(points: Points) -> float:
        """Return how far to the left the corridor's middle is a metre ahead, of points along it; straight on where a side is open."""
        beside = points[(points[:, 0] > 0.3) & (points[:, 0] < 1.5)]
        left, right = beside[beside[:, 1] > 0.0], beside[beside[:, 1] < 0.0]
        if not len(left) or not len(right) or left[:, 1].min() - right[:, 1].max() > 2.5:
            return 0.0
        return float(left[:, 1].min() + right[:, 1].max()) / 2.0


@dataclass
class Creep:
    """Drive very slowly by map and odometry; ends away from what the bumper touches: whoever it is may have to be asked to let it past."""

    around: Surroundings
    goal: Pose
    back_from: Pose | None = None
    drive: Drive = field(init=False)

    def __post_init__(self) -> None:
        self.drive = Drive(self.around, self.goal, laser=False, speed_m_s=CREEP_M_S)

    def step(self, now: Situation) -> Twist | Ended:
        """Creep on."""
        if self.back_from is not None:
            if math.dist(now.odom[:2], self.back_from[:2]) < BACK_M:
                return -BACK_M_S, 0.0
            return Ended(arrived=False, text="the bumper stays pressed" if now.bumped else "touched something")
        if now.bumped:
            self.back_from = now.odom
            return STAND
        return self.drive.step(now)


@dataclass
class Dock:
    """Drive before the dock, then onto it by what the laser sees of its face."""

    around: Surroundings
    dock: Pose
    drive: Drive | None = field(init=False)
    stood_since_s: float | None = None

    def __post_init__(self) -> None:
        back = (-BEFORE_DOCK_M * math.cos(self.dock[2]), -BEFORE_DOCK_M * math.sin(self.dock[2]))
        self.drive = Drive(self.around, (self.dock[0] + back[0], self.dock[1] + back[1], self.dock[2]))

    def step(self, now: Situation) -> Twist | Ended:
        """Drive on."""
        if now.charging:
            return Ended(arrived=True, text="charging")
        if self.drive is not None:
            done = self.drive.step(now)
            if not isinstance(done, Ended):
                return done
            if not done.arrived:
                return done
            self.drive = None
        if now.scan_age_s > BLIND_S:
            return Ended(arrived=False, text=f"no scan for {now.scan_age_s:.1f} s")
        face = self._face(now)
        if face is None:
            return Ended(arrived=False, text="the dock's face is not to be seen")
        gap_m = float(np.hypot(*face))
        if gap_m > GAP_M:
            self.stood_since_s = None
            bearing = math.atan2(face[1], face[0])
            return min(DOCK_M_S, 0.03 + gap_m - GAP_M), max(-0.4, min(0.4, 2.0 * bearing))
        self.stood_since_s = now.now_s if self.stood_since_s is None else self.stood_since_s
        if now.now_s - self.stood_since_s > CONTACT_S:
            return Ended(arrived=False, text="stands before the dock without contact")
        return STAND

    def _face(self, now: Situation) -> Points | None:
        """Return the middle of the dock's face, (2,) in base_link."""
        expected = transformed(inverse(now.pose), transformed(self.dock, np.array([[GAP_M, 0.0]])))[0]
        near = now.points[np.linalg.norm(now.points - expected, axis=1) < FACE_M]
        if len(near) < 5:
            return None
        front = near[near[:, 0] < near[:, 0].min() + 0.06]
        return np.array([front[:, 0].min(), (front[:, 1].min() + front[:, 1].max()) / 2.0])
