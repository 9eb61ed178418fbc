"""The zero of the autopilot's height: a barometer's, which jumps, walks, and drifts at a rate that is nearly the same for minutes (gtsam).

While the vehicle flies straight, a drift looks like a map that is tilted along the way: 0.015 m/s at 1 m/s are 0.86 degrees. Where it
climbs, hovers or turns, only the drift goes on. So heights count there, too, though no keyframe is made. Which of the two is more likely is
a matter of what is known before: the drift is some millimetres a second, with a long tail (`HeightSettings`), the tilt half a degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import gtsam
import numpy as np

from perception_core import NS

if TYPE_CHECKING:
    from lidar_mapping.keyframes import Keyframe

LEAST_S = 0.1  # between two nodes
JUMP_WITHIN_S = 1.0  # what changed over a longer silence is no jump


@dataclass(frozen=True)
class HeightSettings:
    """What is known of the autopilot's height; metres, seconds.

    It is noisy by ``noise_m``. Its zero walks by ``walk_m`` a root second and drifts by ``drift_m_s``, of which more than ``tail`` times
    that counts less and less (Cauchy); the rate walks by ``drift_walk_m_s`` a root second. What changes by more than ``jump_m`` from one
    sweep to the next is a jump. On a known map the zero is known to ``known_m``. While the vehicle stays near a keyframe, a height counts
    every ``stay_s``, and after long stays every tenth of their time.
    """

    noise_m: float = 0.03
    walk_m: float = 0.005
    drift_m_s: float = 0.0035
    tail: float = 0.8
    drift_walk_m_s: float = 0.0005
    jump_m: float = 0.1
    known_m: float = 0.3
    stay_s: float = 1.0


@dataclass
class _Node:
    """The zero at one moment: what is to be added to a height in the map for that of the autopilot, and its rate."""

    stamp_ns: int
    zero_m: float
    rate_m_s: float


class BarometerZero:
    """Hears each height, and ties those of keyframes and stays to the keyframes' poses by factors of a graph."""

    def __init__(self, settings: HeightSettings, factors: gtsam.NonlinearFactorGraph) -> None:
        self._settings, self._factors = settings, factors
        self._nodes: list[_Node] = []
        self._jumped_m = 0.0
        self._last: tuple[int, float] | None = None
        self._above_m = 0.0

    @property
    def drifted_m(self) -> float:
        """How much higher the autopilot takes the vehicle to be than at the start, but for jumps; 0 while nothing was heard."""
        return self._above_m - self._nodes[0].zero_m if self._nodes else 0.0

    @property
    def rate_m_s(self) -> float:
        """The drift's rate."""
        return self._nodes[-1].rate_m_s if self._nodes else 0.0

    def hear(self, stamp_ns: int, height_m: float, up_m: float) -> None:
        """Take the autopilot's height at the end of a sweep, and the height in the map, which the scan says."""
        above_m = height_m - up_m
        if self._last is not None and 0 < stamp_ns - self._last[0] < JUMP_WITHIN_S * NS:
            step_m = above_m - self._last[1]
            self._jumped_m += step_m if abs(step_m) > self._settings.jump_m else 0.0
        self._last = stamp_ns, above_m
        self._above_m = above_m - self._jumped_m

    def forget(self) -> None:
        """Take the next height for no jump: the map was moved, or the vehicle was not seen."""
        self._last = None

    def due(self, stamp_ns: int, keyframe: Keyframe) -> bool:
        """Return whether a height that belongs to no keyframe shall count."""
        if not self._nodes:
            return False
        stayed_s = (stamp_ns - keyframe.stamp_ns) / NS
        return (stamp_ns - self._nodes[-1].stamp_ns) / NS >= max(self._settings.stay_s, 0.1 * stayed_s)

    def tie(self, stamp_ns: int, keyframe: int, keyframe_up_m: float) -> None:
        """Tie the height that was heard last to a keyframe's pose, which has the height ``keyframe_up_m`` in the map now."""
        settings, isotropic = self._settings, gtsam.noiseModel.Isotropic.Sigma
        node = len(self._nodes)
        if node:
            before = self._nodes[-1]
            passed_s = max(abs(stamp_ns - before.stamp_ns) / NS, LEAST_S)
            self._factors.add(_drifting(node, passed_s, isotropic(1, settings.walk_m * np.sqrt(passed_s))))
            rate_walk = isotropic(1, settings.drift_walk_m_s * np.sqrt(passed_s))
            self._factors.add(gtsam.BetweenFactorDouble(_rate(node - 1), _rate(node), 0.0, rate_walk))
            self._nodes.append(_Node(stamp_ns, before.zero_m + passed_s * before.rate_m_s, before.rate_m_s))
        else:
            known = isotropic(1, settings.known_m if keyframe else 1e-3)
            self._factors.add(gtsam.PriorFactorDouble(_zero(node), self._above_m, known))
            cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(settings.tail)
            drift = gtsam.noiseModel.Robust.Create(cauchy, isotropic(1, settings.drift_m_s))
            self._factors.add(gtsam.PriorFactorDouble(_rate(node), 0.0, drift))
            self._nodes.append(_Node(stamp_ns, self._above_m, 0.0))
        measured = _pressure_kpa(self._above_m + keyframe_up_m)
        self._factors.add(gtsam.BarometricFactor(keyframe, _zero(node), measured, isotropic(1, settings.noise_m)))

    def insert_into(self, values: gtsam.Values) -> None:
        """Add what is known of all zeros and rates."""
        for n, node in enumerate(self._nodes):
            values.insert(_zero(n), node.zero_m)
            values.insert(_rate(n), node.rate_m_s)

    def take_from(self, values: gtsam.Values) -> None:
        """Take what the optimisation has found."""
        for n, node in enumerate(self._nodes):
            node.zero_m, node.rate_m_s = values.atDouble(_zero(n)), values.atDouble(_rate(n))


def _zero(node: int) -> int:
    return int(gtsam.symbol("h", node))


def _rate(node: int) -> int:
    return int(gtsam.symbol("r", node))


def _drifting(node: int, passed_s: float, walk: gtsam.noiseModel.Isotropic) -> gtsam.LinearContainerFactor:
    """Return the factor that says: the zero of a node is that of the node before, and what its rate makes of the time between."""
    one, at = np.eye(1), gtsam.Values()
    for key in (_zero(node), _zero(node - 1), _rate(node - 1)):
        at.insert(key, 0.0)
    linear = gtsam.JacobianFactor(_zero(node), one, _zero(node - 1), -one, _rate(node - 1), -passed_s * one, np.zeros(1), walk)
    return gtsam.LinearContainerFactor(linear, at)


def _pressure_kpa(height_m: float) -> float:
    """Return the pressure for which gtsam's factor takes a height: it is made for a barometer's readings."""
    return float(gtsam.BarometricFactor().baroOut(height_m))
