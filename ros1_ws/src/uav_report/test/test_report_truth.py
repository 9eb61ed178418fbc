"""Clearance, collisions and rest from a path and a world whose answers are known by hand."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from alula.report.history import History
from alula.report.observed import Observed
from alula.report.phases import find_phases
from uav_report.flight import moving_again
from uav_report.phases import FlightPhases, flight_phases, touch_down
from uav_report.recording import GuidanceAccount, Recording, SimulatorAccount, Track
from uav_report.truth import VEHICLE_RADIUS_M, Encounter, disagreement, encounter, impact, rests, told_or_computed
from uav_report.world import TrueSurfaces

sys.path.insert(0, str(Path(__file__).parent))
from test_report_sample import mesh_of, path_through

from alula_testing.run_log import LIFT_OFF_S

GROUND = ([-20, -20], [40, 20])
STAND_M = 0.3  # the centre's height on the ground


def flight(*places, wall_y_m=4.0, boxes=()) -> tuple[Track, TrueSurfaces, FlightPhases]:
    """Take off at the origin to 3 m in 3 s, fly through the places at 2 m/s, land in 3 s; a wall stands at y = wall_y_m."""
    up = path_through([(0, 0, STAND_M), (0, 0, 3)], speed_m_s=0.9, start_s=LIFT_OFF_S)
    on = path_through([(0, 0, 3), *places], speed_m_s=2.0, start_s=up[0][-1])
    end = on[1][-1]
    down = path_through([end, (end[0], end[1], STAND_M)], speed_m_s=0.9, start_s=on[0][-1])
    still = (np.linspace(0.05, 2.0, 40), np.zeros((40, 3)))
    parts = [(LIFT_OFF_S - still[0][::-1], still[1] + up[1][0]), up, on, down, (down[0][-1] + still[0], still[1] + down[1][-1])]
    t_s, first = np.unique(np.concatenate([part[0] for part in parts]), return_index=True)
    track = Track(t_s, np.concatenate([part[1] for part in parts])[first])
    world = TrueSurfaces(*mesh_of([((-20, wall_y_m, 0), (40, wall_y_m + 0.3, 8)), *boxes], GROUND))
    phases = FlightPhases(LIFT_OFF_S, "simulator", departed=True, cruise_s=up[0][-1], landing_s=on[0][-1], back_s=down[0][-1])
    return track, world, phases


def test_the_wall_beside_the_path_decides_not_the_ground_of_take_off_and_landing():
    found = encounter(*flight((10, 0, 3), wall_y_m=1.9))
    assert found.min_clearance_m == pytest.approx(1.9 - VEHICLE_RADIUS_M, abs=1e-5)
    assert found.collisions == 0
    assert found.distance_m == pytest.approx(10.0 + 2 * (3 - STAND_M), abs=1e-6)


def test_the_ground_counts_in_flight():
    found = encounter(*flight((5, 0, 1.2), (10, 0, 3), wall_y_m=9.0))
    assert found.min_clearance_m == pytest.approx(1.2 - VEHICLE_RADIUS_M, abs=0.05)  # 20 Hz at 2 m/s


def test_a_wall_beside_the_take_off_counts_above_1_5_m():
    # At 0.7 m from the wall the vehicle touches it while it climbs; in flight it leaves at once.
    found = encounter(*flight((0, -6, 3), wall_y_m=0.7))
    assert found.collisions == 1
    assert found.min_clearance_m == pytest.approx(0.7 - VEHICLE_RADIUS_M, abs=1e-5)


def test_each_entry_is_one_collision():
    post = [((x, 0.5, 0), (x + 0.2, 0.7, 6)) for x in (4.0, 9.0, 14.0)]
    found = encounter(*flight((20, 0, 3), wall_y_m=15.0, boxes=post))
    assert found.collisions == 3
    assert found.min_clearance_m == pytest.approx(0.5 - VEHICLE_RADIUS_M, abs=0.01)


def test_without_phases_told_the_heights_decide():
    track, world, known = flight((10, 0, 3), wall_y_m=4.0)
    found = encounter(track, world, FlightPhases(LIFT_OFF_S, "simulator", departed=True, back_s=known.touch_down_s))
    assert found.min_clearance_m == pytest.approx(2.0 - VEHICLE_RADIUS_M, abs=0.05)
    assert encounter(track, world, known).min_clearance_m == pytest.approx(2.0 - VEHICLE_RADIUS_M, abs=0.05)


def test_heights_count_from_the_place_of_take_off():
    track, world, phases = flight((10, 0, 3), wall_y_m=4.0)
    raised = TrueSurfaces(world.vertices + np.array([0, 0, 50]), world.triangles)
    lifted = Track(track.t_s, track.position_enu_m + np.array([0, 0, 50]))
    assert encounter(lifted, raised, phases).min_clearance_m == pytest.approx(encounter(track, world, phases).min_clearance_m, abs=1e-4)


def test_what_is_not_known_is_none():
    track, world, phases = flight((10, 0, 3))
    assert encounter(None, world, phases) == Encounter()
    assert encounter(track, None, phases) == Encounter(None, None, pytest.approx(15.4))
    assert encounter(track, world, FlightPhases(LIFT_OFF_S, "first event")) == Encounter(None, None, 0.0)


def test_rest():
    track, world, phases = flight((10, 0, 3))
    assert rests(track, world, phases) is True
    lied = replace(phases, back_s=phases.landing_s)
    assert rests(track.between(0.0, phases.touch_down_s - 1.5), world, lied) is False
    assert rests(track.between(0.0, phases.landing_s + 0.1), world, lied) is False
    assert rests(track.between(0.0, phases.touch_down_s - 1.5), world, phases) is None, "the recording broke off before"
    assert rests(track.between(phases.zero_s + 1.0, np.inf), world, phases) is None
    assert rests(track, None, phases) is None
    before = track.between(0.0, phases.zero_s - 0.1)
    assert rests(before, world, replace(phases, back_s=None)) is None, "the recording broke off before the lift-off"


def test_a_landing_on_a_roof_is_a_rest():
    track, world, phases = flight((10, 0, 3 + 1.0), boxes=[((8, -2, 0), (12, 2, 1.0))])
    raised = track.position_enu_m.copy()
    raised[track.t_s >= phases.landing_s, 2] += 1.0 * np.linspace(0, 1, (track.t_s >= phases.landing_s).sum()).clip(max=1.0)
    raised[track.t_s >= phases.touch_down_s, 2] = 1.0 + STAND_M
    assert rests(Track(track.t_s, raised), world, phases) is True


def ending_with(heights_m) -> tuple[Track, FlightPhases]:
    """Fly, and come down through these heights at 20 Hz; the last one is where it stays."""
    track, _, phases = flight((10, 0, 3))
    flown = track.between(0.0, phases.landing_s)
    heights_m = np.concatenate([heights_m, np.full(30, heights_m[-1])])
    t_s = flown.t_s[-1] + 0.05 * np.arange(1, len(heights_m) + 1)
    end = np.column_stack([np.full(len(t_s), 10.0), np.zeros(len(t_s)), heights_m])
    return Track(np.concatenate([flown.t_s, t_s]), np.concatenate([flown.position_enu_m, end])), phases


def falling(from_m: float, *, ground_m: float = STAND_M, sinks_in_m: float = 0.0):
    """Return the heights of a fall, and of the springing back of a ground that gives way."""
    heights = from_m - 4.903 * (0.05 * np.arange(100)) ** 2
    return [*heights[heights > ground_m], ground_m - sinks_in_m, ground_m - sinks_in_m / 2, ground_m]


@pytest.mark.parametrize(
    ("heights_m", "speed_m_s"),
    [
        (np.arange(3.0, STAND_M, -0.5 * 0.05), None),  # LAND
        (np.arange(3.0, STAND_M, -2.5 * 0.05), None),  # a pilot's throttle at zero
        ([*np.arange(3.0, 0.7, -0.5 * 0.05), STAND_M], None),  # an estimate that jumps by 0.4 m at the touch-down
        (np.arange(3.0, STAND_M, -3.5 * 0.05), 3.5),
        (falling(3.0), 6.0),
        (falling(3.0, sinks_in_m=0.4), 6.0),
    ],
)
def test_an_impact_is_told_from_a_landing_by_the_path(heights_m, speed_m_s):
    track, phases = ending_with(heights_m)
    told = impact(track, phases)
    if speed_m_s is None:
        assert told == ""
    else:
        assert float(told.removeprefix("it met the ground at ").removesuffix(" m/s or more")) == pytest.approx(speed_m_s, abs=1.0)


FELT = SimulatorAccount(12.0, collisions=1, min_clearance_m=2.0, distance_m=50.0, faults=(), crash="it met the ground at 7.7 m/s")


def test_an_impact_counts_whoever_has_felt_it():
    assert told_or_computed(FELT, Encounter()).crash == "it met the ground at 7.7 m/s"
    assert told_or_computed(FELT, Encounter(crash="it met the ground at 7.0 m/s or more")).crash == "it met the ground at 7.7 m/s"
    found = told_or_computed(replace(FELT, collisions=0, crash=""), Encounter(crash="it met the ground at 7.0 m/s or more"))
    assert (found.collisions, found.crash) == (1, "it met the ground at 7.0 m/s or more")


def test_there_is_one_truth_the_simulators_where_it_told_one():
    """A landing that touches something beside it, and an autopilot that says late that it lands: the path takes both for something else."""
    said = replace(FELT, crash="")
    recomputed = Encounter(collisions=0, min_clearance_m=-0.85, distance_m=49.0)
    assert told_or_computed(said, recomputed) == Encounter(1, 2.0, 50.0)
    assert told_or_computed(None, recomputed) == recomputed
    assert told_or_computed(replace(said, collisions=None, min_clearance_m=None, distance_m=None), recomputed) == recomputed
    assert disagreement(Recording(simulator=said), recomputed) == ""


def test_a_way_of_another_length_is_said():
    said, far = replace(FELT, distance_m=50.0), Encounter(distance_m=40.0)
    assert disagreement(Recording(simulator=said), far) == "the simulator counted 50.0 m flown, the true path is 40.0 m long"
    assert disagreement(Recording(simulator=replace(said, distance_m=41.0)), far) == ""
    assert disagreement(Recording(), far) == ""


def test_phases_from_the_guidance_alone():
    states = [
        (0.0, "idle", 1),
        (1.0, "takeoff", 3),
        (5.0, "position", 2),
        (20.0, "land", 4),
        (22.0, "position", 2),
        (30.0, "land", 4),
        (36.0, "idle", 1),
    ]
    guidance = tuple(GuidanceAccount(t_s, reference, "GUIDED", landed) for t_s, reference, landed in states)
    observed = Observed(departed_s=1.0, departed_by="simulator", back_s=touch_down(guidance))
    phases = flight_phases(find_phases(History(), observed), History(), guidance)
    # The landing at 20 s was broken off: what follows it is flight.
    assert (phases.zero_s, phases.cruise_s, phases.landing_s, phases.touch_down_s) == (1.0, 5.0, 30.0, 36.0)


@pytest.mark.parametrize(
    ("speeds", "expected"),
    [
        ([0, 0, 1, 0, 0, 0, 1, 1], 2.0),  # sets off, stops again
        ([0, 0, 0, 0, 1, 1, 1, 1], 4.0),  # stands from the start
        ([1, 1, 1, 1, 1, 1, 1, 1], 0.0),  # never stopped
        ([0, 0, 0, 0, 0, 0, 0, 0], None),  # never set off
    ],
)
def test_moving_again(speeds, expected):
    # Each speed is held for a second; samples ten times a second, speeds by central differences.
    t_s = np.arange(0, len(speeds), 0.1)
    x = np.concatenate([[0.0], np.cumsum(np.repeat(speeds, 10)[:-1] * 0.1)])
    track = Track(t_s, np.stack([x, 0 * x, 0 * x], axis=1))
    found = moving_again(track, 0.0, None)
    assert found == (None if expected is None else pytest.approx(expected, abs=0.11))


def test_coming_down_is_no_moving_on():
    t_s = np.arange(0, 10, 0.1)
    track = Track(t_s, np.stack([0 * t_s, 0 * t_s, 10 - t_s], axis=1))
    assert moving_again(track, 2.0, None) is None
