"""What the pose graph tells apart by itself: a map that is tilted, an autopilot that leans, and a barometer that drifts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidar_mapping.graph import GraphSettings, PoseGraph
from lidar_mapping.registration import RegistrationSettings
from perception_core import NS

SPEED_M_S = 1.0
STEP_M = 0.6
TURN_STEPS = 8
STEP_S = 0.6
NOISE_M = 0.005
TURN_NOISE_RAD = 0.0003


class Flown:
    """Keyframes of a scan matcher along legs of these lengths, metres, with corners of 90 degrees between; nothing is seen of loops.

    The map is tilted as the autopilot ``leans`` about the body's axes, (roll, pitch) in radians, when it begins; each keyframe adds a
    little. The autopilot's height is off by ``raised(t)``.
    """

    def __init__(self, legs_m, *, leans=(0.0, 0.0), raised=lambda _t: 0.0, seed=0) -> None:
        rng = np.random.default_rng(seed)
        self.all, self.true_up_m = [], []
        self.graph = PoseGraph(GraphSettings(), RegistrationSettings())
        self.correction = np.eye(4)
        lean = Rotation.from_rotvec([*leans, 0.0])
        bend, position, yaw, t = lean, np.array([0.0, 0.0, 3.0]), 0.0, 0.0
        seen = position.copy()
        for leg, length_m in enumerate(legs_m):
            for k in range(TURN_STEPS * (leg > 0) + round(length_m / STEP_M)):
                turning = leg > 0 and k < TURN_STEPS
                move = np.zeros(3) if turning else STEP_M * np.array([np.cos(yaw), np.sin(yaw), 0.0])
                yaw += np.pi / 2.0 / TURN_STEPS if turning else 0.0
                t += STEP_S
                bend = Rotation.from_rotvec(rng.normal(0.0, TURN_NOISE_RAD, 3)) * bend
                position, seen = position + move, seen + bend.apply(move)
                truth = Rotation.from_euler("z", yaw)
                said = np.eye(4)
                said[:3, :3], said[:3, 3] = (truth * lean).as_matrix(), position
                said[2, 3] += raised(t) + rng.normal(0.0, NOISE_M)
                self._add(t, (bend * truth).as_matrix(), seen, said)
                self.true_up_m.append(position[2])

    def surface(self, *_where, **_among) -> None:
        """Nothing is known around a place: no loop can be closed."""

    def _add(self, t, rotation, position, said) -> None:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        pose = self.correction @ pose
        self.graph.barometer.hear(round(t * NS), said[2, 3], pose[2, 3])
        self.all.append(SimpleNamespace(stamp_ns=round(t * NS), pose=pose, patches=None, everywhere=False))
        if self.graph.add(self, said, 0.001):
            self.correction = self.all[-1].pose @ np.linalg.inv(pose) @ self.correction
            self.graph.barometer.forget()

    @property
    def off_m(self) -> np.ndarray:
        """By how much the keyframes' heights are off in the end, as far as they are optimised."""
        return np.array([frame.pose[2, 3] for frame in self.all]) - self.true_up_m


@pytest.mark.parametrize("leans", [(0.003, 0.003), (-0.003, 0.003), (0.0087, -0.0087)])
@pytest.mark.parametrize("rate_m_s", [0.0, 0.004, -0.015])
def test_a_lean_and_a_drift_are_told_apart_once_the_vehicle_has_turned(leans, rate_m_s) -> None:
    flown = Flown([22.0, 14.0], leans=leans, raised=lambda t: rate_m_s * t)
    assert np.abs(flown.off_m).max() < 0.08
    assert flown.graph.lean_rad == pytest.approx(leans, abs=0.002)
    assert flown.graph.barometer.rate_m_s == pytest.approx(rate_m_s, abs=0.002)


@pytest.mark.parametrize("begins_s", [5.0, 10.0, 18.0])
@pytest.mark.parametrize("rate_m_s", [0.015, -0.015])
def test_a_drift_that_begins_on_a_straight_leg_is_found_on_it(begins_s, rate_m_s) -> None:
    flown = Flown([30.0], leans=(0.003, -0.003), raised=lambda t: rate_m_s * max(0.0, t - begins_s))
    assert np.abs(flown.off_m).max() < 0.08
    assert flown.graph.barometer.rate_m_s == pytest.approx(rate_m_s, abs=0.002)
    (change_s,) = flown.graph.barometer.changes_s
    assert change_s == pytest.approx(begins_s, abs=2.0)


@pytest.mark.parametrize("seed", range(5))
def test_a_height_that_wavers_is_no_drift_that_begins(seed) -> None:
    flown = Flown([22.0, 14.0, 22.0], leans=(0.003, 0.003), raised=lambda t: 0.01 * np.sin(t / 8.0), seed=seed)
    assert flown.graph.barometer.changes_s == []
    assert np.abs(flown.off_m).max() < 0.08
