"""How near the vehicle truly came to the world: by the simulator's count, or where there is none computed from the true path.

Of a path, from the moment when the take-off has ended or has reached 2 m, and until the landing begins, every surface counts. Before and
after, the ground below is no obstacle, it is where the vehicle comes from or goes to: then only moments above 1.5 m count,
and only if the nearest surface is not the one below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_report.phases import FlightPhases
from uav_report.recording import Recording, SimulatorAccount, Track
from uav_report.world import TrueSurfaces

VEHICLE_RADIUS_M = 0.85  # with propellers
LOW_M = 1.5  # height of the vehicle's centre above the place of take-off
CRUISE_HEIGHT_M = 2.0
BELOW_DEG = 45.0  # a surface within this cone around straight down is the ground that one starts from or lands on
REST_S = 1.0
REST_MOVE_M = 0.1
REST_HEIGHT_M = 0.2
DISTANCE_AGREES = 0.05
HARD_M_S = 3.0  # down: no landing, also not a pilot's with the throttle at zero
IMPACT_S = 0.2  # before the vehicle came to rest; long enough for a few poses, so that a jump of an estimated place is no fall
TOUCHED_M = 0.05


@dataclass(frozen=True)
class Encounter:
    """How near the vehicle came. ``min_clearance_m``: from its radius to the nearest surface; None where that can't be known."""

    collisions: int | None = None
    min_clearance_m: float | None = None
    distance_m: float | None = None
    crash: str = ""
    """How the vehicle crashed on its way down; empty: it did not, or nothing is known of it."""


def encounter(track: Track | None, world: TrueSurfaces | None, phases: FlightPhases) -> Encounter:
    """Compute the encounter from the true track (None: unknown)."""
    if track is None:
        return Encounter()
    down_s = np.inf if phases.touch_down_s is None else phases.touch_down_s
    flown = track.between(phases.zero_s, np.nextafter(down_s, np.inf))
    distance_m = flown.length_m() if phases.lifted_off else 0.0
    if world is None or not phases.lifted_off:
        return Encounter(distance_m=distance_m)
    clearance, counts = clearances(track, world, phases)
    if not counts.any():
        return Encounter(collisions=0, distance_m=distance_m)
    return Encounter(entries_below_zero(clearance, counts), float(clearance[counts].min()), distance_m)


def clearances(track: Track, world: TrueSurfaces, phases: FlightPhases) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the clearance in metres at each sample of the track, (N,), and which of the samples count, (N,)."""
    nearest = world.nearest(track.position_enu_m) - track.position_enu_m
    distance = np.linalg.norm(nearest, axis=1)
    below = -nearest[:, 2] > distance * np.cos(np.radians(BELOW_DEG))
    height = track.position_enu_m[:, 2] - _ground_height(track, world, phases)
    high = height >= LOW_M
    cruise = (track.t_s >= _cruise_begins(track, height, phases)) & (track.t_s < _landing_begins(track, height, phases))
    airborne = (track.t_s >= phases.zero_s) & (track.t_s < (np.inf if phases.touch_down_s is None else phases.touch_down_s))
    return distance - VEHICLE_RADIUS_M, airborne & (cruise | (high & ~below))


def entries_below_zero(clearance: NDArray[np.float64], counts: NDArray[np.bool_]) -> int:
    """Count how often a clearance that counts falls below zero; staying there is one collision."""
    touching = np.concatenate([[False], (clearance < 0) & counts])
    return int((touching[1:] & ~touching[:-1]).sum())


def _ground_height(track: Track, world: TrueSurfaces, phases: FlightPhases) -> float:
    """Return z of the surface on which the vehicle stood before lift-off (or over which the path begins)."""
    before = track.t_s <= phases.zero_s
    place = track.position_enu_m[before][-1] if before.any() else track.position_enu_m[0]
    above = _height_above_surface(world, place)
    return float(place[2] - (above if np.isfinite(above) else 0.0))


def _cruise_begins(track: Track, height: NDArray[np.float64], phases: FlightPhases) -> float:
    """Return the end of the take-off, or the moment when it reached 2 m if that is earlier."""
    high = track.t_s[(height >= CRUISE_HEIGHT_M) & (track.t_s >= phases.zero_s)]
    return min(np.inf if phases.cruise_s is None else phases.cruise_s, high[0] if len(high) else np.inf)


def _landing_begins(track: Track, height: NDArray[np.float64], phases: FlightPhases) -> float:
    """Return the beginning of the landing; if none was recorded, the last moment above 2 m, if the flight ended at all."""
    if phases.landing_s is not None:
        return phases.landing_s
    high = track.t_s[height >= CRUISE_HEIGHT_M]
    return np.inf if phases.touch_down_s is None or not len(high) else float(high[-1])


def rests(track: Track | None, world: TrueSurfaces | None, phases: FlightPhases) -> bool | None:
    """Return whether the vehicle stands still on a surface at the end as it did before lift-off; None if that can't be known."""
    if track is None or world is None or track.t_s[0] > phases.zero_s:
        return None
    if track.t_s[-1] < (phases.zero_s if phases.touch_down_s is None else phases.touch_down_s):
        return None  # the recording broke off before
    end = track.between(track.t_s[-1] - REST_S, np.inf).position_enu_m
    heights = [_height_above_surface(world, place) for place in (end[-1], track.position_enu_m[0])]
    still = np.ptp(end, axis=0).max() < REST_MOVE_M
    return bool(still and heights[0] - heights[1] < REST_HEIGHT_M)


def impact(track: Track | None, phases: FlightPhases) -> str:
    """Return in words how the vehicle met what it rests on, if that was no landing; for one that is known to rest (`rests`)."""
    if track is None or not phases.lifted_off:
        return ""
    t_s, height = track.t_s, track.position_enu_m[:, 2]
    above = np.flatnonzero(np.abs(height - height[-1]) > TOUCHED_M)
    if not len(above):
        return ""
    touch = int(above[-1])
    begin = int(np.searchsorted(t_s, t_s[touch] - IMPACT_S))
    passed_s = t_s[touch] - t_s[begin]
    sink_m_s = float((height[begin] - height[touch]) / passed_s) if passed_s > 0.0 else 0.0
    return f"it met the ground at {sink_m_s:.1f} m/s or more" if sink_m_s > HARD_M_S else ""


def _height_above_surface(world: TrueSurfaces, place: NDArray[np.float64]) -> float:
    return float(world.first_hit_m(place, np.array([[0.0, 0.0, -1.0]]))[0])


def told_or_computed(simulator: SimulatorAccount | None, recomputed: Encounter) -> Encounter:
    """Return the simulator's numbers; where it has none, those of the recorded path.

    The simulator counts at each step of the body, and knows what is ground and whether the vehicle stands, flies or lands. The path knows
    less: what the autopilot has said of that, and surfaces that are all alike. It has seen a crash that the simulator had no time to tell.
    """
    if simulator is None:
        return recomputed
    crash = simulator.crash or recomputed.crash
    collisions = recomputed.collisions if simulator.collisions is None else simulator.collisions
    return Encounter(
        collisions=max(collisions or 0, 1) if crash else collisions,
        min_clearance_m=recomputed.min_clearance_m if simulator.min_clearance_m is None else simulator.min_clearance_m,
        distance_m=recomputed.distance_m if simulator.distance_m is None else simulator.distance_m,
        crash=crash,
    )


def disagreement(recording: Recording, recomputed: Encounter) -> str:
    """Return in words where the simulator's way and the recorded one differ by more than sampling explains: a part is missing."""
    said = recording.simulator
    if said is None or said.distance_m is None or recomputed.distance_m is None:
        return ""
    pair = (said.distance_m, recomputed.distance_m)
    if abs(pair[0] - pair[1]) <= 0.5 + DISTANCE_AGREES * max(pair):
        return ""
    return f"the simulator counted {pair[0]:.1f} m flown, the true path is {pair[1]:.1f} m long"
