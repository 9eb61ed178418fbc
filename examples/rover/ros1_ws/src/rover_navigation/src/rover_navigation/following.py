"""Following a way: pure pursuit (Coulter, "Implementation of the pure pursuit path tracking algorithm", 1992), slower before obstacles."""

from __future__ import annotations

import math

import numpy as np

from rover_navigation.geometry import Points, Pose, inverse, transformed

AHEAD_M = (0.45, 0.3, 0.15)  # the points of the way that are steered for, the next one where there is no getting to the one before
TURN_FIRST_RAD = 0.7  # with more to turn it turns where it stands
TURN_RAD_S, TURN_GAIN = 1.0, 2.0
BODY_M = 0.29  # radius, with a margin for what the laser measures and for the step until the next command
LOOK_S = 1.6  # so far ahead it looks along its arc
BRAKE_M_S2 = 0.6
Twist = tuple[float, float]
"""m/s forwards, rad/s to the left."""
STAND: Twist = (0.0, 0.0)


def carrots(way: Points, pose: Pose) -> Points:
    """Return the points of the way to steer for, (N, 2) in base_link, the best one first."""
    local = transformed(inverse(pose), way)
    far = np.linalg.norm(local, axis=1)
    nearest = int(np.argmin(far))
    beyond = [np.nonzero(far[nearest:] > ahead)[0] for ahead in AHEAD_M]
    return np.array([local[nearest + int(some[0])] if len(some) else local[-1] for some in beyond], dtype=np.float64)


def towards(point: Points, speed_m_s: float) -> Twist:
    """Return the twist of the arc to a point in base_link."""
    bearing = math.atan2(point[1], point[0])
    if abs(bearing) > TURN_FIRST_RAD:
        return turn(bearing)
    distance = max(float(np.hypot(*point)), 0.1)
    v = min(speed_m_s, 0.05 + distance) * math.cos(bearing)
    return v, max(-TURN_RAD_S, min(TURN_RAD_S, 2.0 * v * math.sin(bearing) / distance))


def turn(angle_rad: float, most_rad_s: float = TURN_RAD_S) -> Twist:
    """Return the twist that turns by an angle where it stands; not slower than friction allows."""
    return 0.0, math.copysign(max(0.15, min(most_rad_s, TURN_GAIN * abs(angle_rad))), angle_rad)


def free_m(twist: Twist, points: Points) -> float:
    """Return how far the rover gets on its arc until it touches something; infinity: as far as it looks."""
    if not len(points) or twist[0] == 0.0:
        return math.inf
    times = np.arange(0.0, LOOK_S, 0.1)
    yaw = twist[1] * times
    forward = twist[0] * times
    arc = np.column_stack((forward * np.cos(yaw / 2.0), forward * np.sin(yaw / 2.0)))
    near = np.linalg.norm(arc[:, None, :] - points[None, :, :], axis=2)
    # What is near already does not hold it where it drives away from it.
    hits = np.nonzero(((near < BODY_M) & (near < near[0] - 1e-3)).any(axis=1))[0]
    return float(abs(forward[hits[0]])) if len(hits) else math.inf


def careful(twist: Twist, points: Points) -> Twist:
    """Return the twist, slowed down on the same arc so far that it can stop before what is in the way."""
    for part in (1.0, 0.7, 0.4, 0.2):
        slower = (part * twist[0], part * twist[1])
        if free_m(slower, points) > slower[0] ** 2 / (2.0 * BRAKE_M_S2) + 0.02:
            return slower if twist[0] else twist
    return STAND


def steer(goals: Points, speed_m_s: float, points: Points) -> Twist:
    """Return the twist to the first of the goals (in base_link) that there is a way to: on an arc, or straight after a turn to it.

    Turning it touches nothing, for it is round. So where the arc leads into something, as next to a person who has come near, it is not
    held by what it need not drive into.
    """
    for goal in goals:
        twist = careful(towards(goal, speed_m_s), points)
        if twist != STAND:
            return twist
        bearing = math.atan2(goal[1], goal[0])
        if careful((speed_m_s, 0.0), transformed((0.0, 0.0, -bearing), points)) != STAND:
            return turn(bearing)
    return STAND
