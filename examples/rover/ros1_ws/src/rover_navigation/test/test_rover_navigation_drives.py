"""Drives without ROS: planner, follower, localisation and monitors over the simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rover_navigation_rig import Rig

from rover_navigation.geometry import compose, points_of
from rover_navigation.jobs import Corridor, Creep, Dock, Drive, Ended
from rover_navigation.matching import apart, locate, match, search
from rover_navigation.planning import RADIUS_M, NoWayError, plan, plan_anew

KITCHEN, OFFICE, WORKSHOP = (2.6, 8.6, math.pi), (13.4, 8.8, 0.0), (13.6, 1.6, 0.0)
ARRIVED = Ended(arrived=True, text="arrived")


def off_m(rig):
    return math.dist(rig.pose[:2], rig.simulation.floor.pose[:2])


def test_it_drives_to_a_room_along_the_corridor_and_onto_the_dock():
    rig = Rig()
    assert rig.run(Drive(rig.around, KITCHEN)) == ARRIVED
    assert math.dist(rig.simulation.floor.pose[:2], KITCHEN[:2]) < 0.2
    assert off_m(rig) < 0.1
    assert rig.run(Drive(rig.around, (5.0, 5.4, 0.0))) == ARRIVED
    assert rig.run(Corridor((10.0, 5.4, 0.0))) == ARRIVED
    assert rig.run(Dock(rig.around, rig.world.dock)) == Ended(arrived=True, text="charging")
    assert rig.simulation.truth.collisions == 0
    assert set(rig.heard) == {"OK", "GOOD"}


@pytest.mark.parametrize(
    ("fault", "verdict"),
    [
        ("laser:dead@3", "SILENT"),
        ("laser:frozen@3", "FROZEN"),
        ("laser:covered@3", "COVERED"),
        ("wheels:slip@3", "SLIPPING"),
        ("wheels:weak@3", "WEAK"),
        ("bumper:stuck@3", "STUCK"),
        ("pose:lost@3", "LOST"),
    ],
)
def test_each_fault_is_noticed_by_what_is_measured_and_by_nothing_else(fault, verdict):
    rig = Rig(fault)
    rig.run(Drive(rig.around, OFFICE), 6.0)
    assert verdict not in rig.heard
    rig.run(Drive(rig.around, OFFICE), 5.0)
    assert verdict in rig.heard
    assert set(rig.heard) <= {"OK", "GOOD", verdict}


def test_without_the_laser_it_refuses_to_drive_but_creeps_and_stops_at_what_it_touches():
    rig = Rig("laser:dead@3", doors=())
    assert rig.run(Drive(rig.around, OFFICE)).text.startswith("no scan")
    assert rig.run(Creep(rig.around, (5.0, 5.4, 0.0))) == ARRIVED
    assert off_m(rig) < 0.3
    # Into the kitchen, whose door is shut: that is not on the map.
    assert rig.run(Creep(rig.around, KITCHEN)) == Ended(arrived=False, text="touched something")


def test_by_a_frozen_scan_nothing_is_driven_nor_located():
    rig = Rig("laser:frozen@3")
    assert rig.run(Drive(rig.around, OFFICE)).text.startswith("no scan")
    assert rig.run(Creep(rig.around, (5.0, 5.4, 0.0))) == ARRIVED
    assert "FROZEN" in rig.heard
    assert off_m(rig) < 0.3
    assert rig.simulation.truth.collisions == 0


def test_a_person_who_stays_in_the_door_is_given_up_with_a_reason():
    rig = Rig("person:stays")
    ended = rig.run(Drive(rig.around, WORKSHOP))
    assert not ended.arrived
    assert "way" in ended.text
    assert rig.simulation.truth.collisions == 0


@pytest.mark.parametrize("bearing", np.arange(0.0, 2.0 * math.pi, math.pi / 6.0).tolist())
def test_it_gets_away_from_who_stands_next_to_it(bearing):
    rig = Rig()
    here, goal = (13.0, 2.2, 2.75), (11.0, 2.2, math.pi)
    rig.stand(here, person=(here[0] + 0.58 * math.cos(bearing), here[1] + 0.58 * math.sin(bearing)))
    assert rig.run(Drive(rig.around, goal)) == ARRIVED
    assert rig.simulation.truth.collisions == 0


@pytest.mark.parametrize(
    ("pose", "person"), [((14.05, 5.56, 2.77), (13.61, 5.89)), ((8.0, 5.3, math.pi), (7.2, 5.2)), ((9.0, 5.4, 0.0), (9.8, 5.6))]
)
def test_along_a_corridor_it_gets_around_who_stands_there(pose, person):
    rig = Rig(doors=())
    rig.stand(pose, person=person)
    goal = (3.0, 5.4, math.pi) if abs(pose[2]) > 1.0 else (14.5, 5.4, 0.0)
    assert rig.run(Corridor(goal)) == ARRIVED
    assert rig.simulation.truth.collisions == 0


def turned(rig):
    """Turn the rover once; return the scans that a search is given, and the true pose at the last one."""
    scans, turned_rad, before = [], 0.0, rig.simulation.wheels.odometry
    while turned_rad < math.tau:
        rig.simulation.wheels.command(0.0, 0.8, rig.simulation.now_s)
        rig.simulation.step()
        odom = rig.simulation.wheels.odometry
        turned_rad, before = turned_rad + abs(math.remainder(odom[2] - before[2], math.tau)), odom
        if turned_rad >= len(scans) * math.radians(40.0) and (sweep := rig.simulation.sweep()) is not None:
            outside = np.where(sweep.ranges_m < RADIUS_M, np.inf, sweep.ranges_m)
            scans.append((odom, points_of(outside, sweep.angle_min_rad, sweep.angle_step_rad)))
            true = rig.simulation.floor.pose
    return scans, true


def test_a_rover_that_was_carried_away_is_found_on_the_whole_map():
    rig = Rig("pose:lost@3")
    rig.run(Drive(rig.around, OFFICE), 8.0)
    scans, true = turned(rig)
    best, other = search(rig.grid, scans)[:2]
    assert best.quality > 0.9
    assert math.dist(best.pose[:2], true[:2]) < 0.05
    assert abs(math.remainder(best.pose[2] - true[2], math.tau)) < 0.03
    assert best.quality - other.quality > 0.1
    assert apart(best.pose, other.pose)


@pytest.mark.parametrize("doors", [("kitchen", "office", "workshop", "store", "side"), ()], ids=["open", "shut"])
def test_wherever_it_was_carried_to_it_is_found_or_nobody_knows(doors):
    """Rooms are alike, and where doors are shut, which the map does not have, a wrong place may fit better than the right one."""
    rig, random = Rig(doors=doors), np.random.default_rng(3)
    free = np.argwhere(rig.grid.distance_m > 0.35)
    known = 0
    for cell in random.choice(free, 12):
        (place,) = rig.grid.middles(cell[None])
        rig.simulation.floor.carry((*place.tolist(), random.uniform(-math.pi, math.pi)))
        scans, true = turned(rig)
        found, why = locate(rig.grid, scans)
        known += found is not None
        assert found is None or not apart(found, true), (true, why)
    assert known >= (11 if doors else 8)


def test_close_to_a_shut_door_of_a_bare_corridor_two_places_fit():
    rig = Rig(doors=())
    rig.simulation.floor.carry((5.3, 6.0, 2.0))
    found, why = locate(rig.grid, turned(rig)[0])
    assert (found, why.split(",")[0]) == (None, "two places fit")


def test_a_scan_is_matched_from_a_guess_that_is_off():
    rig = Rig()
    sweep = rig.simulation.sweep()
    points = points_of(sweep.ranges_m, sweep.angle_min_rad, sweep.angle_step_rad)
    found = match(rig.grid, compose(rig.simulation.floor.pose, (0.1, -0.08, 0.05)), points)
    assert math.dist(found.pose[:2], rig.simulation.floor.pose[:2]) < 0.05
    assert match(rig.grid, (9.0, 2.0, 1.0), points).quality < 0.5


def test_plans_keep_away_from_walls_and_say_why_there_is_none():
    rig = Rig()
    way = plan(rig.around, rig.pose, OFFICE)
    assert rig.grid.distance_m[rig.grid.cells(way[10:])].min() > 0.25
    with pytest.raises(NoWayError, match=r"\(8.00, 2.00\) is taken"):
        plan(rig.around, rig.pose, (8.0, 2.0, 0.0))
    rig.around.seen_s[rig.grid.cells(np.column_stack((np.full(40, 2.0), np.linspace(4.4, 6.4, 40))))] = 0.0
    with pytest.raises(NoWayError, match="too narrow"):
        plan(rig.around, rig.pose, OFFICE)


def test_what_was_not_seen_for_longest_is_forgotten_where_it_leaves_no_way():
    rig = Rig()
    now_s, rows = rig.simulation.now_s, np.linspace(4.4, 6.4, 40)
    old, new, fresh = (rig.grid.cells(np.column_stack((np.full(40, x), rows))) for x in (2.0, 4.0, 3.0))  # the third before all doors
    rig.around.seen_s[old], rig.around.seen_s[new] = now_s - 30.0, now_s - 10.0
    nearer = (3.0, 5.4, 0.0)
    assert len(plan_anew(rig.around, rig.pose, nearer, now_s))
    assert not rig.around.seen[old].any()
    assert rig.around.seen[new].all()
    rig.around.seen_s[old], rig.around.seen_s[fresh] = now_s - 30.0, now_s
    with pytest.raises(NoWayError, match="too narrow"):
        plan_anew(rig.around, rig.pose, OFFICE, now_s)
    assert rig.around.seen[old].all()  # nothing is forgotten for nothing


def test_a_door_that_is_shut_is_seen_and_the_other_way_taken():
    rig = Rig(doors=("office", "side"))
    assert rig.run(Drive(rig.around, KITCHEN), 150.0) == ARRIVED
    assert rig.simulation.truth.distance_m > 20.0  # through the office
    assert rig.simulation.truth.collisions == 0
