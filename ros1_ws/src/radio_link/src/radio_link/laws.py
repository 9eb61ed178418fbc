"""How the radio depends on where the vehicle is: by the zones of the world, or by a law of distance and obstruction. Pure.

The laws give a path loss in dB between the ground station's antenna and the vehicle (frame map: ENU, metres). What rate it leaves
follows from the signal-to-noise ratio as in 3GPP TR 36.942, annex A.2: a part of Shannon's bound, none below a least ratio.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from radio_link.conditions import PRESETS, Both, Quality

Point = tuple[float, float, float]
Corners = tuple[Point, Point]
PathLoss = Callable[[Point, Point, Sequence[Corners]], float]

LIGHT_M_S = 299_792_458.0
FREQUENCY_HZ = 2.4e9
WAVELENGTH_M = LIGHT_M_S / FREQUENCY_HZ


@dataclass(frozen=True, kw_only=True)
class LinkBudget:
    """A radio of the 2.4 GHz band at the limit of ETSI EN 300 328 (100 mW EIRP), shared with others."""

    eirp_dbm: float = 20.0
    receive_gain_dbi: float = 2.0
    noise_figure_db: float = 7.0
    interference_db: float = 25.0  # how far others in the band lift the noise in a town
    bandwidth_hz: float = 2e6
    share_up: float = 0.25  # of the rate, for the way to the drone
    # 3GPP TR 36.942, annex A.2, uplink
    shannon_part: float = 0.4
    least_snr_db: float = -10.0
    most_bps_per_hz: float = 2.0

    def snr_db(self, path_loss_db: float) -> float:
        """Return the signal-to-noise ratio; thermal noise is -174 dBm/Hz."""
        noise_dbm = -174.0 + 10.0 * math.log10(self.bandwidth_hz) + self.noise_figure_db + self.interference_db
        return self.eirp_dbm + self.receive_gain_dbi - path_loss_db - noise_dbm

    def rate_bps(self, path_loss_db: float) -> float:
        """Return the rate that the link carries, bits per second."""
        snr_db = self.snr_db(path_loss_db)
        if snr_db < self.least_snr_db:
            return 0.0
        efficiency = self.shannon_part * math.log2(1.0 + 10.0 ** (snr_db / 10.0))
        return self.bandwidth_hz * min(efficiency, self.most_bps_per_hz)


def free_space_db(station: Point, vehicle: Point, _boxes: Sequence[Corners] = ()) -> float:
    """Return the loss of free space (Friis; ITU-R P.525)."""
    distance_m = max(math.dist(station, vehicle), WAVELENGTH_M)
    return 20.0 * math.log10(4.0 * math.pi * distance_m / WAVELENGTH_M)


def two_ray_db(station: Point, vehicle: Point, _boxes: Sequence[Corners] = ()) -> float:
    """Return the loss with the reflection from flat ground: both rays summed with their phases, reflection -1 (Rappaport, section 4.6)."""
    across_m = math.hypot(vehicle[0] - station[0], vehicle[1] - station[1])
    direct_m = max(math.hypot(across_m, vehicle[2] - station[2]), WAVELENGTH_M)
    reflected_m = max(math.hypot(across_m, vehicle[2] + station[2]), WAVELENGTH_M)
    phase = 2.0 * math.pi * (reflected_m - direct_m) / WAVELENGTH_M
    field = complex(1.0 / direct_m, 0.0) - complex(math.cos(phase), -math.sin(phase)) / reflected_m
    return -20.0 * math.log10(max(abs(field) * WAVELENGTH_M / (4.0 * math.pi), 1e-9))


def obstructed_db(station: Point, vehicle: Point, boxes: Sequence[Corners] = ()) -> float:
    """Return the loss of free space and of the worst edge in the way: single knife edge, ITU-R P.526, equation 31."""
    edges = [_knife_edge_db(station, vehicle, box) for box in boxes]
    return free_space_db(station, vehicle) + max(edges, default=0.0)


def _knife_edge_db(station: Point, vehicle: Point, box: Corners) -> float:
    """Return the loss behind a box: over its roof or around the nearer side, whichever is less."""
    inside = _crossing(station, vehicle, box)
    if inside is None:
        return 0.0
    enter, leave = inside
    middle = (enter + leave) / 2.0
    at = tuple(a + middle * (b - a) for a, b in zip(station, vehicle, strict=True))
    clearance_m = min(box[1][2] - at[2], *_detours_m(station, vehicle, box))
    distance_m = math.dist(station, vehicle)
    near_m, far_m = max(middle * distance_m, 0.1), max((1.0 - middle) * distance_m, 0.1)
    v = max(clearance_m, 0.0) * math.sqrt(2.0 / WAVELENGTH_M * (1.0 / near_m + 1.0 / far_m))
    return 6.9 + 20.0 * math.log10(math.sqrt((v - 0.1) ** 2 + 1.0) + v - 0.1)


def _detours_m(start: Point, end: Point, box: Corners) -> tuple[float, float]:
    """Return how far the outermost upright edges of a box are from the way on the ground plan, on its left and on its right."""
    east, north = end[0] - start[0], end[1] - start[1]
    length_m = max(math.hypot(east, north), 1e-9)
    corners = [(x, y) for x in (box[0][0], box[1][0]) for y in (box[0][1], box[1][1])]
    left = [(east * (y - start[1]) - north * (x - start[0])) / length_m for x, y in corners]
    return max(left), max(-offset for offset in left)


def _crossing(start: Point, end: Point, box: Corners) -> tuple[float, float] | None:
    """Return the parts of the way, 0 to 1, at which it enters and leaves a box; None where it misses it."""
    enter, leave = 0.0, 1.0
    for a, b, low, high in zip(start, end, box[0], box[1], strict=True):
        if abs(b - a) < 1e-12:
            if not low <= a <= high:
                return None
            continue
        near, far = sorted(((low - a) / (b - a), (high - a) / (b - a)))
        enter, leave = max(enter, near), min(leave, far)
    return (enter, leave) if enter < leave else None


LAWS: dict[str, PathLoss] = {"free_space": free_space_db, "two_ray": two_ray_db, "obstructed": obstructed_db}
"""The laws that may stand in the place of the world's zones."""


def condition_by_law(law: PathLoss, station: Point, vehicle: Point, boxes: Sequence[Corners], budget: LinkBudget) -> Both:
    """Return the radio at a place: the rate of the law; delay and losses as in the quality whose rate is next below."""
    rate_bps = budget.rate_bps(law(station, vehicle, boxes))
    quality = next((q for q in Quality if rate_bps >= PRESETS[q].down.rate_bps), Quality.OUT)
    preset = PRESETS[quality]
    return Both(replace(preset.down, rate_bps=rate_bps), replace(preset.up, rate_bps=rate_bps * budget.share_up))
