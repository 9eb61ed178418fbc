"""The vehicle is flown by the SLAM's map: conversions, how the correction is followed, and flights of the pure guidance by it."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from guidance_fake_autopilot import GUIDED
from guidance_pure_flight import PureFlight
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from uav_guidance.frames import quaternion_enu_flu, rotated, turned_about_vertical, wrap, yaw_of
from uav_guidance.guidance import Guidance
from uav_guidance.localization import NO_CORRECTION, Correction, Localization, Transform
from uav_guidance.requests import HeadingRequest, TakeoffRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import ZERO, Vec3

STEP_S = 0.05
LEVEL = (0.0, 0.0, 0.0, 1.0)

near = st.floats(-100.0, 100.0)
places = st.builds(Vec3, near, near, near)
angles = st.floats(-20.0, 20.0)
corrections = st.builds(Correction, angles, places)
anything = st.floats(allow_nan=True, allow_infinity=True)
transforms = st.builds(Transform, st.tuples(anything, anything, anything, anything), st.builds(Vec3, anything, anything, anything))


def about_vertical(yaw_rad: float, translation: Vec3) -> Transform:
    return Transform(turned_about_vertical(LEVEL, yaw_rad), translation)


def told(
    localization: Localization, transform: Transform, now_s: float, *, problem: str = "", running: bool = True, scans: int = 50
) -> None:
    localization.hear_transform(transform)
    localization.hear_state(running=running, problem=problem, scans=scans, now_s=now_s)


def begun(**changes: float) -> Localization:
    """Return one that has stood on the ground with an identity, for longer than the mapping takes to settle."""
    localization = Localization(GuidanceSettings(**changes))
    told(localization, Transform(LEVEL, ZERO), -10.0)
    told(localization, Transform(LEVEL, ZERO), 0.0)
    localization.step(ZERO, 0.0, flying=False)
    return localization


# ---- conversions -----------------------------------------------------------------------------------------------------------


@given(corrections, places)
def test_there_and_back_is_the_same_place(correction, place):
    assert (correction.to_odom(correction.to_map(place)) - place).norm < 1e-9
    assert (correction.to_map(correction.to_odom(place)) - place).norm < 1e-9


@given(places)
def test_without_a_correction_nothing_changes_by_a_single_bit(place):
    assert NO_CORRECTION.to_map(place) == place
    assert NO_CORRECTION.to_odom(place) == place


@given(places, places, angles)
def test_a_correction_between_two_coordinates_of_a_place_turns_one_into_the_other(in_odom, in_map, yaw):
    correction = Correction.between(in_odom, in_map, yaw)
    assert (correction.to_map(in_odom) - in_map).norm < 1e-9


@given(st.floats(-1.4, 1.4), st.floats(-1.4, 1.4), angles, places)
def test_quaternions_turn_as_those_of_scipy(roll, pitch, yaw, vector):
    quaternion = quaternion_enu_flu(roll, pitch, yaw)
    theirs = Rotation.from_quat(quaternion)
    assert theirs.apply([vector.x, vector.y, vector.z]) == pytest.approx(list(vars_of(rotated(quaternion, vector))), abs=1e-9)
    assert wrap(yaw_of(quaternion) - theirs.as_euler("ZYX")[0]) == pytest.approx(0.0, abs=1e-9)
    turned = Rotation.from_quat(turned_about_vertical(quaternion, 0.7)).as_matrix()
    assert turned == pytest.approx((Rotation.from_euler("z", 0.7) * theirs).as_matrix(), abs=1e-9)


def vars_of(v: Vec3) -> tuple[float, float, float]:
    return v.x, v.y, v.z


def test_a_tilt_of_the_transform_does_not_lift_a_vehicle_far_from_the_origin():
    tilt = Rotation.from_euler("y", math.radians(0.5))
    place = Vec3(40.0, 0.0, 3.0)
    away = tilt.apply([40.0, 0.0, 3.0])
    correction = Transform(tuple(tilt.as_quat()), Vec3(*(vars_of(place)[axis] - away[axis] for axis in range(3)))).level_at(place)
    assert (correction.to_map(place) - place).norm < 1e-9


# ---- following -------------------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(-0.15, 0.15), st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), places), min_size=1, max_size=20))
def test_place_and_heading_move_at_a_bounded_rate_wherever_the_vehicle_is(steps):
    limits = GuidanceSettings(map_jump_m=100.0, map_jump_rad=3.0)
    localization = begun(map_jump_m=100.0, map_jump_rad=3.0)
    for count, (yaw, x, y, place) in enumerate(steps, start=1):
        now_s = count * STEP_S
        told(localization, about_vertical(yaw, Vec3(x, y, 0.0)), now_s)
        before, heading = localization.correction.to_map(place), localization.correction.yaw_rad
        assert not localization.step(place, now_s, flying=True)
        assert (localization.correction.to_map(place) - before).norm <= limits.map_rate_m_s * STEP_S + 1e-9
        assert abs(wrap(localization.correction.yaw_rad - heading)) <= limits.map_rate_rad_s * STEP_S + 1e-9


def test_it_arrives_at_the_newest_transform():
    localization = begun()
    place, goal = Vec3(30.0, 10.0, 3.0), about_vertical(0.02, Vec3(0.3, -0.2, 0.1))
    for count in range(200):
        told(localization, goal, count * STEP_S)
        localization.step(place, count * STEP_S, flying=True)
    assert localization.correction == goal.level_at(place)


@given(transforms, places)
def test_numbers_that_are_none_never_get_in(transform, place):
    localization = begun()
    told(localization, transform, STEP_S)
    localization.step(place, STEP_S, flying=True)
    assert localization.correction.to_map(place).finite
    assert math.isfinite(localization.correction.yaw_rad)


@pytest.mark.parametrize(
    "transform",
    [
        Transform(LEVEL, Vec3(math.nan, 0.0, 0.0)),
        Transform(LEVEL, Vec3(0.0, math.inf, 0.0)),
        Transform(LEVEL, Vec3(1e300, 0.0, 0.0)),
        Transform((0.0, 0.0, 0.0, 0.0), ZERO),
        Transform((0.0, 0.0, 0.0, 2.0), ZERO),
        Transform((math.nan, 0.0, 0.0, 1.0), ZERO),
    ],
)
def test_what_is_no_rigid_motion_is_left_out(transform):
    localization = begun()
    told(localization, transform, STEP_S)
    localization.step(ZERO, STEP_S, flying=False)
    assert localization.correction == NO_CORRECTION


@pytest.mark.parametrize("kept", ["lost", "stopped", "silent", "started again"])
def test_the_last_correction_is_kept_while_the_mapping_is(kept):
    localization = begun()
    told(localization, about_vertical(0.0, Vec3(0.5, 0.0, 0.0)), 1.0)
    localization.step(ZERO, 1.0, flying=False)
    for now_s in (1.1, 2.0, 3.0, 4.0):
        localization.hear_transform(about_vertical(0.0, Vec3(9.0, 0.0, 0.0)))
        if kept != "silent":
            problem = "no scan fitted" if kept == "lost" else ""
            localization.hear_state(running=kept != "stopped", problem=problem, scans=0 if kept == "started again" else 60, now_s=now_s)
        localization.step(ZERO, now_s, flying=False)
        assert localization.correction.shift_m == Vec3(0.5, 0.0, 0.0)
    for now_s in (5.0, 8.0):
        told(localization, about_vertical(0.0, Vec3(0.7, 0.0, 0.0)), now_s, scans=100)
    localization.step(ZERO, 8.0, flying=False)
    assert localization.correction.shift_m == Vec3(0.7, 0.0, 0.0)


def test_a_guidance_that_has_just_started_takes_what_a_stopped_mapping_holds_but_not_what_a_lost_one_does():
    for problem, shift in (("", 0.5), ("no scan fitted", 0.0)):
        localization = Localization(GuidanceSettings())
        localization.hear_state(running=False, problem=problem, scans=50, now_s=100.0)
        localization.hear_transform(about_vertical(0.0, Vec3(0.5, 0.0, 0.0)))
        localization.step(ZERO, 100.0, flying=True)
        assert localization.correction.shift_m.x == shift


def test_the_first_correction_and_a_far_one_are_taken_at_once_and_told():
    localization = Localization(GuidanceSettings())
    for now_s in (0.0, 5.0, 10.0):
        told(localization, about_vertical(0.0, Vec3(0.6, 0.0, 0.0)), now_s)
    assert localization.step(ZERO, 10.0, flying=True)
    assert localization.correction.shift_m.x == 0.6
    told(localization, about_vertical(0.0, Vec3(1.5, 0.0, 0.0)), 10.05)
    assert not localization.step(ZERO, 10.05, flying=True)
    assert localization.correction.shift_m.x == pytest.approx(0.61)
    told(localization, about_vertical(0.0, Vec3(7.0, 0.0, 0.0)), 10.1)
    assert localization.step(ZERO, 10.1, flying=True)
    assert localization.correction.shift_m.x == 7.0
    told(localization, about_vertical(0.3, Vec3(7.0, 0.0, 0.0)), 10.15)
    assert localization.step(ZERO, 10.15, flying=True)
    assert localization.correction.yaw_rad == pytest.approx(0.3)


def raised(localization, rate_m_s, now_s, *, from_m=0.0, seconds=60.0, flying=True):
    """Tell a map that rises above the autopilot's height at a rate; return what is made of it at the end, metres."""
    for count in range(round(seconds / STEP_S) + 1):
        passed_s = count * STEP_S
        told(localization, about_vertical(0.0, Vec3(0.0, 0.0, from_m + rate_m_s * passed_s)), now_s + passed_s)
        localization.step(ZERO, now_s + passed_s, flying=flying)
    return localization.correction.shift_m.z


@pytest.mark.parametrize("rate_m_s", [0.015, -0.015, 0.028])
def test_a_height_that_drifts_as_a_barometer_does_is_followed_but_not_without_end(rate_m_s):
    settings, localization = GuidanceSettings(), begun()
    followed_s = settings.map_height_most_m / abs(rate_m_s)
    assert raised(localization, rate_m_s, 1.0, seconds=followed_s) == pytest.approx(followed_s * rate_m_s, abs=0.01)
    # What goes on may be the map, which must not take the vehicle along to the ground.
    most_m = math.copysign(settings.map_height_most_m + settings.map_height_m, rate_m_s)
    assert raised(localization, rate_m_s, followed_s, from_m=followed_s * rate_m_s, seconds=400.0) == pytest.approx(most_m, abs=0.01)


def test_a_map_that_leaves_the_measured_height_faster_than_a_barometer_drifts_is_followed_within_bounds():
    settings, localization = GuidanceSettings(), begun()
    assert raised(localization, 0.0, 1.0, from_m=0.5 * settings.map_height_m, seconds=10.0) == pytest.approx(0.5 * settings.map_height_m)
    for count in range(6):  # on and on, at last by 30 m
        most_m = settings.map_height_m + min(settings.map_height_m_s * (60.0 * (count + 1) + 10.0), settings.map_height_most_m)
        assert raised(localization, 0.1, 20.0 + 60.0 * count, from_m=0.1 + 6.0 * count) <= most_m + 0.01
    before_m = localization.correction.shift_m.z
    assert raised(localization, 0.0, 1000.0, from_m=6.1, seconds=0.0) == pytest.approx(before_m - 30.0, abs=0.05), "another origin"
    assert raised(localization, 0.0, 2000.0, from_m=-3.0, seconds=10.0, flying=False) == -3.0, "on the ground the map's height counts"


def test_switched_off_it_returns_to_the_autopilots_position_evenly():
    localization = begun()
    told(localization, about_vertical(0.0, Vec3(0.5, 0.0, 0.0)), 1.0)
    localization.step(ZERO, 1.0, flying=False)
    localization.tune(GuidanceSettings(follow_map=False))
    assert not localization.step(ZERO, 1.05, flying=True)
    assert localization.correction.shift_m.x == pytest.approx(0.49)
    for count in range(60):
        localization.step(ZERO, 1.1 + count * STEP_S, flying=True)
    assert localization.correction == NO_CORRECTION


def test_a_clock_that_is_set_back_or_pauses_makes_no_step():
    localization = begun()
    goal = about_vertical(0.0, Vec3(0.9, 0.0, 0.0))
    told(localization, goal, 10.0)
    for now_s, most_m in ((100.0, 0.04), (99.0, 0.0), (200.0, 0.04)):
        before = localization.correction.shift_m.x
        localization.step(ZERO, now_s, flying=True)
        assert localization.correction.shift_m.x - before <= most_m + 1e-9


# ---- flights ---------------------------------------------------------------------------------------------------------------


class Mapped:
    """A flight whose autopilot drifts, and a mapping that knows by how much: T_map_odom is told at 10 Hz."""

    def __init__(self, flight: PureFlight) -> None:
        self.flight = flight
        self.T_map_odom = Correction()
        self.problem = ""
        self.scans = 0
        self._due_s = 0.0

    @property
    def truth(self) -> Vec3:
        """Where the vehicle is in `map`."""
        return self.T_map_odom.to_map(Vec3(*self.flight.vehicle.enu))

    def run(self, duration_s: float, drift_m_s: float = 0.0) -> float:
        """Fly on; return the largest step between two setpoints, metres."""
        flight, end_s, first = self.flight, self.flight.now_s + duration_s, len(self.flight.setpoints)
        last = flight.setpoints[-1][1].position_enu_m if first else None
        while flight.now_s < end_s:
            self.T_map_odom = Correction(self.T_map_odom.yaw_rad, self.T_map_odom.shift_m + Vec3(0.0, drift_m_s * 0.02, 0.0))
            self.tell()
            flight.tick()
        points = ([] if last is None else [last]) + [setpoint.position_enu_m for _, setpoint in flight.setpoints[first:]]
        return max(((b - a).norm for a, b in pairwise(points)), default=0.0)

    def tell(self) -> None:
        if self.flight.now_s < self._due_s:
            return
        self._due_s = self.flight.now_s + 0.1
        guidance, here = self.flight.guidance, self.T_map_odom
        self.scans += 1
        guidance.on_transform(about_vertical(here.yaw_rad, here.shift_m))
        guidance.on_mapping(running=True, problem=self.problem, scans=self.scans, now_s=self.flight.now_s)


@pytest.fixture
def mapped(flying):
    mapped = Mapped(flying)
    mapped.run(4.0)
    return mapped


def test_flies_to_the_place_in_the_map_though_the_autopilot_drifts(mapped):
    mapped.flight.go(20.0, 0.0)
    step_m = mapped.run(25.0, drift_m_s=0.1)
    assert abs(Vec3(*mapped.flight.vehicle.enu).y) > 2.0, "the autopilot believes to be elsewhere"
    assert (mapped.truth - Vec3(20.0, 0.0, 3.0)).norm < 0.25
    assert step_m < 0.3
    mapped.run(3.0)
    assert (mapped.truth - Vec3(20.0, 0.0, 3.0)).norm < 0.1
    assert mapped.flight.report.course.remaining_enu_m.norm < 0.1
    assert (mapped.flight.report.vehicle.position_enu_m - mapped.truth).norm < 0.05


def test_switched_off_it_flies_by_the_autopilots_position(mapped):
    mapped.flight.guidance.tune(GuidanceSettings(follow_map=False))
    mapped.flight.go(20.0, 0.0)
    mapped.run(25.0, drift_m_s=0.1)
    assert Vec3(*mapped.flight.vehicle.enu).y == pytest.approx(0.0, abs=0.1)
    assert mapped.truth.y > 2.0


def test_the_heading_is_that_of_the_map(mapped):
    mapped.T_map_odom = Correction(0.1, ZERO)
    mapped.flight.ask(HeadingRequest(1.0, 0.5))
    mapped.run(10.0)
    assert math.pi / 2 - mapped.flight.vehicle.body.yaw + 0.1 == pytest.approx(1.0, abs=0.02)
    assert mapped.flight.report.vehicle.yaw_rad == pytest.approx(1.0, abs=0.02)
    assert (mapped.truth - Vec3(0.0, 0.0, 3.0)).norm < 0.1


def test_a_loop_that_moves_the_map_by_metres_does_not_make_the_vehicle_jump(mapped, said):
    mapped.flight.go(20.0, 0.0, along=True)
    mapped.run(8.0)
    mapped.T_map_odom = Correction(0.0, Vec3(0.0, 3.0, 0.0))
    place = mapped.flight.vehicle.enu
    assert mapped.run(0.5) < 2.0, "the carrot begins again at the vehicle"
    assert math.dist(mapped.flight.vehicle.enu[1:], place[1:]) < 0.3
    assert said() == ["the vehicle's place in map jumps by 3.00 m and 0.0 degrees"]
    mapped.run(25.0)
    assert (mapped.truth - Vec3(20.0, 0.0, 3.0)).norm < 0.1


def test_a_map_that_jumps_during_the_climb_leaves_the_climb_upright(flight):
    mapped = Mapped(flight)
    flight.until(lambda r: r.authority and r.vehicle.ready)
    mapped.run(4.0)
    decision = flight.ask(TakeoffRequest(4.0, 1.5))
    while flight.report.vehicle.landed != 3:
        mapped.run(0.1)
    assert decision.procedure.outcome.accepted
    mapped.run(0.5)
    mapped.T_map_odom = Correction(0.0, Vec3(0.0, 3.0, 0.0))
    mapped.run(8.0)
    assert flight.vehicle.enu == pytest.approx((0.0, 0.0, 4.0), abs=0.15)
    assert flight.report.course.remaining_enu_m.norm < 0.15


def test_a_lost_mapping_leaves_the_vehicle_where_it_is(mapped):
    mapped.T_map_odom = Correction(0.0, Vec3(0.0, 0.4, 0.0))
    mapped.run(5.0)
    place = mapped.flight.vehicle.enu
    mapped.problem = "no scan fitted the map for 2.1 s"
    mapped.run(0.2)
    mapped.T_map_odom = Correction(0.0, Vec3(50.0, 0.0, 0.0))
    mapped.run(5.0)
    assert mapped.flight.vehicle.enu == pytest.approx(place, abs=0.05)


def test_a_guidance_that_is_started_again_in_flight_begins_with_the_newest_correction(mapped):
    mapped.flight.go(20.0, 0.0)
    mapped.run(10.0, drift_m_s=0.1)
    flight = mapped.flight
    flight.guidance = Guidance(GuidanceSettings())
    place = flight.vehicle.enu
    flight.setpoints.clear()
    mapped.run(3.0)
    assert flight.report.course.reference == "hover"
    assert math.dist(flight.vehicle.enu, place) < 1.0, "it stops, and no more"
    assert (flight.report.vehicle.position_enu_m - mapped.truth).norm < 0.05
    flight.go(20.0, 0.0)
    mapped.run(15.0)
    assert (mapped.truth - Vec3(20.0, 0.0, 3.0)).norm < 0.1


def test_an_autopilot_that_counts_from_another_origin_is_found_again_in_the_map(mapped):
    flight = mapped.flight
    flight.go(4.0, 0.0)
    mapped.run(10.0)
    flight.vehicle.restart(GUIDED)
    while flight.report.vehicle.boots == 1:  # the mapping, too, hears of the new origin by the guidance's pose
        mapped.run(0.02)
    place = flight.vehicle.enu
    mapped.T_map_odom = Correction(0.0, Vec3(4.0, 0.0, 0.0))
    mapped.run(6.0)
    assert flight.report.course.reference == "hover"
    assert math.dist(flight.vehicle.enu, place) < 1.0, "it stops, and no more"
    assert (flight.report.vehicle.position_enu_m - mapped.truth).norm < 0.05
    assert flight.report.vehicle.home_enu_m == Vec3(4.0, 0.0, 0.0), "home is the new origin, as the autopilot says"


def test_the_fence_counts_from_where_home_was_when_the_autopilot_set_it(mapped):
    mapped.T_map_odom = Correction(0.0, Vec3(0.0, 0.9, 0.0))
    mapped.run(8.0)
    radius_m = GuidanceSettings().fence_radius_m
    assert not mapped.flight.guidance.fence_reason(Vec3(0.0, radius_m - 0.1, 3.0))
    assert mapped.flight.guidance.fence_reason(Vec3(0.0, radius_m + 0.1, 3.0))
