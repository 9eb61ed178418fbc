"""The zero of the autopilot's height: a barometer's, which jumps, walks, and drifts at a rate that is nearly the same for minutes (gtsam).

While the vehicle flies straight, a drift looks like a map that is tilted along the way: 0.015 m/s at 1 m/s are 0.86 degrees. Where it
climbs, hovers or turns, only the drift goes on. So heights count there, too, though no keyframe is made. Which of the two is more likely is
a matter of what is known before: the drift is some millimetres a second, with a long tail (`HeightSettings`), the tilt half a degree.

A drift that begins in flight bends the heights along the way, which a tilt does not. A rate that walks would follow such a bend with a
delay and leave the rest to the map. So the rate is also allowed to change at once, at the node where that explains the heights best, as
soon as it explains them much better (the likelihood ratio of a change, as in tests for outliers).
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
DOUBTED = 100  # nodes, the last ones, a minute and more: what changed before has been found
LEAST_EXPLAINED = 1e-6  # of a walk's variance: less is rounding


@dataclass(frozen=True)
class HeightSettings:
    """What is known of the autopilot's height; metres, seconds.

    It is noisy by ``noise_m``. Its zero walks by ``walk_m`` a root second and drifts by ``drift_m_s``, of which more than ``tail`` times
    that counts less and less (Cauchy); the rate walks by ``drift_walk_m_s`` a root second, and changes by ``change_m_s`` where twice the
    logarithm of the likelihood ratio for that exceeds ``change_gain``. What changes by more than ``jump_m`` from one sweep to the next is a
    jump. On a known map the zero is known to ``known_m``. While the vehicle stays near a keyframe, a height counts every ``stay_s``, and
    after long stays every tenth of their time.
    """

    noise_m: float = 0.01
    walk_m: float = 0.003
    drift_m_s: float = 0.0035
    tail: float = 0.8
    drift_walk_m_s: float = 0.0005
    change_m_s: float = 0.015
    change_gain: float = 2.0
    jump_m: float = 0.1
    known_m: float = 0.3
    stay_s: float = 1.0


@dataclass
class _Node:
    """The zero at one moment: what is to be added to a height in the map for that of the autopilot, and its rate."""

    stamp_ns: int
    zero_m: float
    rate_m_s: float
    walk: int | None = None
    """The factor that ties the rate to that of the node before; None where there is none, or the rate may change at once."""


class BarometerZero:
    """Receives each height, and ties those of keyframes and stays to the keyframes' poses by factors of a graph."""

    def __init__(self, settings: HeightSettings, factors: gtsam.NonlinearFactorGraph) -> None:
        self._settings, self._factors = settings, factors
        self._nodes: list[_Node] = []
        self._jumped_m = 0.0
        self._last: tuple[int, float] | None = None
        self._above_m = 0.0

    @property
    def drifted_m(self) -> float:
        """By how many metres the autopilot's height has drifted since the start, without jumps; 0 before the first height."""
        return self._above_m - self._nodes[0].zero_m if self._nodes else 0.0

    @property
    def rate_m_s(self) -> float:
        """The rate of the drift, m/s."""
        return self._nodes[-1].rate_m_s if self._nodes else 0.0

    @property
    def changes_s(self) -> list[float]:
        """When the rate was allowed to change at once, seconds since the first height."""
        return [(node.stamp_ns - self._nodes[0].stamp_ns) / NS for node in self._nodes[1:] if node.walk is None]

    def hear(self, stamp_ns: int, height_m: float, up_m: float) -> None:
        """Store the autopilot's height at the end of a sweep, and the height in the map by the scan, metres."""
        above_m = height_m - up_m
        if self._last is not None and 0 < stamp_ns - self._last[0] < JUMP_WITHIN_S * NS:
            step_m = above_m - self._last[1]
            self._jumped_m += step_m if abs(step_m) > self._settings.jump_m else 0.0
        self._last = stamp_ns, above_m
        self._above_m = above_m - self._jumped_m

    def forget(self) -> None:
        """Do not take the next height for a jump: the map was moved, or the vehicle was not seen."""
        self._last = None

    def due(self, stamp_ns: int, keyframe: Keyframe) -> bool:
        """Return whether a height that belongs to no keyframe shall count."""
        if not self._nodes:
            return False
        stayed_s = (stamp_ns - keyframe.stamp_ns) / NS
        return (stamp_ns - self._nodes[-1].stamp_ns) / NS >= max(self._settings.stay_s, 0.1 * stayed_s)

    def tie(self, stamp_ns: int, keyframe: int, keyframe_up_m: float) -> None:
        """Tie the height received last to a keyframe's pose, which has the height ``keyframe_up_m`` in the map now."""
        settings, isotropic = self._settings, gtsam.noiseModel.Isotropic.Sigma
        node = len(self._nodes)
        if node:
            before = self._nodes[-1]
            passed_s = max(abs(stamp_ns - before.stamp_ns) / NS, LEAST_S)
            self._factors.add(_drifting(node, passed_s, isotropic(1, settings.walk_m * np.sqrt(passed_s))))
            rate_walk = isotropic(1, settings.drift_walk_m_s * np.sqrt(passed_s))
            self._factors.add(gtsam.BetweenFactorDouble(_rate(node - 1), _rate(node), 0.0, rate_walk))
            walk = self._factors.size() - 1
            self._nodes.append(_Node(stamp_ns, before.zero_m + passed_s * before.rate_m_s, before.rate_m_s, walk))
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
        """Insert the present estimates of all zeros and rates."""
        for n, node in enumerate(self._nodes):
            values.insert(_zero(n), node.zero_m)
            values.insert(_rate(n), node.rate_m_s)

    def take_from(self, values: gtsam.Values) -> None:
        """Store the estimates of an optimisation."""
        for n, node in enumerate(self._nodes):
            node.zero_m, node.rate_m_s = values.atDouble(_zero(n)), values.atDouble(_rate(n))

    def allow_change(self, values: gtsam.Values) -> bool:
        """Let the rate change at once where that explains the heights much better than its walk; return whether there is such a node.

        ``values`` are those that agree best with all factors. What a rate's change would be without the factor of its walk, and how surely,
        follows from the change with it.
        """
        marginals = gtsam.Marginals(self._factors, values)
        doubted = range(max(1, len(self._nodes) - DOUBTED), len(self._nodes))
        gains = {n: self._gain(n, values, marginals) for n in doubted}
        best = max(gains, key=gains.__getitem__, default=0)
        walk = self._nodes[best].walk if gains else None
        if walk is None or gains[best] <= self._settings.change_gain:
            return False
        change = gtsam.noiseModel.Isotropic.Sigma(1, self._settings.change_m_s)
        self._factors.replace(walk, gtsam.BetweenFactorDouble(_rate(best - 1), _rate(best), 0.0, change))
        self._nodes[best].walk = None
        return True

    def _gain(self, node: int, values: gtsam.Values, marginals: gtsam.Marginals) -> float:
        """Return twice the logarithm of the likelihood ratio of a change at a node and the walk up to it."""
        keys, before = (_rate(node - 1), _rate(node)), self._nodes[node - 1]
        if self._nodes[node].walk is None:
            return 0.0
        passed_s = max(abs(self._nodes[node].stamp_ns - before.stamp_ns) / NS, LEAST_S)
        walked = self._settings.drift_walk_m_s**2 * passed_s
        joint = marginals.jointMarginalCovariance(gtsam.KeyVector(list(keys))).fullMatrix()
        left = 1.0 - (joint[0, 0] + joint[1, 1] - 2.0 * joint[0, 1]) / walked  # of the walk's variance, explained by the heights
        if left < LEAST_EXPLAINED:
            return 0.0
        free_m_s = (values.atDouble(keys[1]) - values.atDouble(keys[0])) / left
        free, changed = walked / left, walked / left - walked + self._settings.change_m_s**2
        return float(free_m_s**2 * (1.0 / free - 1.0 / changed) - np.log(changed / free))


def _zero(node: int) -> int:
    return int(gtsam.symbol("h", node))


def _rate(node: int) -> int:
    return int(gtsam.symbol("r", node))


def _drifting(node: int, passed_s: float, walk: gtsam.noiseModel.Isotropic) -> gtsam.LinearContainerFactor:
    """Return the factor by which the zero of a node is that of the node before, and what its rate makes of the time between."""
    one, at = np.eye(1), gtsam.Values()
    for key in (_zero(node), _zero(node - 1), _rate(node - 1)):
        at.insert(key, 0.0)
    linear = gtsam.JacobianFactor(_zero(node), one, _zero(node - 1), -one, _rate(node - 1), -passed_s * one, np.zeros(1), walk)
    return gtsam.LinearContainerFactor(linear, at)


def _pressure_kpa(height_m: float) -> float:
    """Return the pressure for which gtsam's factor takes a height: it is made for a barometer's readings."""
    return float(gtsam.BarometricFactor().baroOut(height_m))
