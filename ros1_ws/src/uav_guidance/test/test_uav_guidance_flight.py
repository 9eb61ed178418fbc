"""Whole flights of the pure state machine against a vehicle that behaves as the real autopilot was seen to."""

from __future__ import annotations

import math

import pytest
from guidance_fake_autopilot import GUIDED, LOITER

from uav_guidance.guidance import Guidance
from uav_guidance.requests import HeadingRequest, HoverRequest, LandRequest, PositionRequest, StopRequest, TakeoffRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Vec3

MODE, ARM, TAKEOFF = "MAV_CMD_DO_SET_MODE", "MAV_CMD_COMPONENT_ARM_DISARM", "MAV_CMD_NAV_TAKEOFF"


def test_no_setpoint_before_the_autopilot_says_in_air(flying):
    flying.run(0.2)
    assert flying.commands == [(MODE, 1.0, GUIDED, 0.0), (ARM, 1.0, 0.0, 0.0), (TAKEOFF, 0.0, 0.0, 3.0)]
    assert [entry for entry in flying.vehicle.transcript if entry[0] == "setpoints"] == [("setpoints", "0x9f8", 2)]
    assert flying.vehicle.enu[2] == pytest.approx(3.0, abs=0.15)
    assert flying.guidance.resources()["flight_status"] == "IN_AIR"


def test_nothing_asked_for_during_the_take_off_can_cancel_it_unheard(flight):
    flight.until(lambda r: r.authority)
    flight.agreed(TakeoffRequest(3.0, 1.5))
    for wanted in (1, 3):
        flight.until(lambda r, wanted=wanted: r.vehicle.landed == wanted)
        for request in (
            PositionRequest(Vec3(5, 0, 3), 1.0, along_travel=False),
            HeadingRequest(1.0, 0.5),
            HeadingRequest(1.0, 0.5, lock=True),
            TakeoffRequest(4.0, 1.0),
        ):
            assert (flight.report.vehicle.landed == 1 and isinstance(request, TakeoffRequest)) or not flight.ask(request).accepted
    flight.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    assert flight.report.course.reference == "takeoff"


def test_hover_before_lift_off_gives_the_take_off_up(flight):
    flight.until(lambda r: r.authority)
    flight.agreed(TakeoffRequest(3.0, 1.5))
    flight.run(1.0)
    assert flight.agreed(HoverRequest()).accepted
    flight.run(5.0)
    assert not flight.vehicle.body.armed
    assert flight.vehicle.enu[2] == 0.0
    assert flight.report.course.reference == "idle"


def test_hover_during_the_climb_stops_there(flight):
    flight.until(lambda r: r.authority)
    flight.agreed(TakeoffRequest(6.0, 1.5))
    flight.until(lambda r: r.vehicle.position_enu_m is not None and r.vehicle.position_enu_m.z > 2.0)
    assert flight.ask(HoverRequest()).accepted
    flight.run(5.0)
    assert 2.0 < flight.vehicle.enu[2] < 3.6


def test_refused_arming_passes_the_autopilots_words_on(flight):
    flight.until(lambda r: r.authority)
    flight.vehicle.refuse_arming = "Battery 1 low voltage"
    decision = flight.agreed(TakeoffRequest(3.0, 1.5))
    assert not decision.accepted
    assert decision.reason == "arm failed: Arm: Battery 1 low voltage"
    flight.run(0.1)
    assert flight.report.course.reference == "idle"


def test_pilot_takes_over_while_it_arms(flight):
    flight.until(lambda r: r.authority)
    flight.vehicle.deaf = True
    decision = flight.ask(TakeoffRequest(3.0, 1.5))
    flight.vehicle.pilot(LOITER)
    flight.run(0.2)
    assert decision.procedure is not None
    assert decision.procedure.outcome is not None
    assert not decision.procedure.outcome.accepted
    assert "LOITER" in decision.procedure.outcome.reason
    flight.vehicle.deaf = False
    flight.run(10.0)
    assert not flight.vehicle.body.armed


def test_deaf_autopilot_is_given_up_after_all_attempts(flight):
    flight.until(lambda r: r.authority)
    flight.vehicle.deaf = True
    decision = flight.agreed(TakeoffRequest(3.0, 1.5))
    assert decision.reason == "arm: the autopilot does not answer"


def test_flies_straight_with_the_nose_along_the_travel(flying):
    decision = flying.go(10.0, 6.0, along=True)
    drift_m = 0.0
    bearing = math.atan2(6.0, 10.0)
    turned_s = flying.until(lambda r: r.course.remaining_enu_m.norm < 11.0)
    assert turned_s > 0.5
    assert abs(flying.report.course.heading_error_rad) < math.radians(15.0)
    while flying.report.course.remaining_enu_m.norm > 0.1:
        flying.tick()
        drift_m = max(drift_m, flying.report.course.drift_m)
        assert flying.report.course.still_s < 1.5
    assert flying.report.reference_id == decision.reference_id
    assert drift_m < 0.2
    assert flying.report.vehicle.yaw_rad == pytest.approx(bearing, abs=0.05)


def test_flies_at_the_speed_asked_for(flying):
    flying.go(30.0, 0.0, speed=2.0)
    flying.until(lambda r: r.course.remaining_enu_m.norm < 22.0)
    began_s, left_m = flying.now_s, flying.report.course.remaining_enu_m.norm
    flying.until(lambda r: r.course.remaining_enu_m.norm < 6.0)
    assert (left_m - flying.report.course.remaining_enu_m.norm) / (flying.now_s - began_s) == pytest.approx(2.0, rel=0.05)


def test_setpoints_come_at_ten_hertz_and_stay_near(flying):
    flying.setpoints.clear()
    flying.go(12.0, 0.0, speed=1.5)
    while flying.report.course.remaining_enu_m.norm > 0.2:
        flying.tick()
        place = flying.report.vehicle.position_enu_m
        assert (flying.setpoints[-1][1].position_enu_m - place).norm < 1.5
    times = [time_s for time_s, _ in flying.setpoints]
    assert (len(times) - 1) / (times[-1] - times[0]) == pytest.approx(10.0, rel=0.05)


def test_locked_heading_stays_while_positions_come_and_go(flying):
    first = flying.go(8.0, 0.0)
    flying.run(1.0)
    assert flying.ask(HeadingRequest(2.0, 0.8, lock=True)).accepted
    assert flying.report.course.reference == "position"
    assert flying.report.reference_id == first.reference_id
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    assert flying.report.vehicle.yaw_rad == pytest.approx(2.0, abs=0.02)
    refused = flying.go(0.0, 0.0, along=True)
    assert refused.reason == "the heading is locked: it can't turn into the travel"
    assert not flying.ask(HeadingRequest(0.0, 0.8)).accepted
    flying.go(0.0, 0.0)
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    assert flying.report.vehicle.yaw_rad == pytest.approx(2.0, abs=0.02)
    assert flying.ask(HeadingRequest(0.0, 0.0, release=True)).accepted
    assert not flying.report.course.heading_locked
    assert flying.go(4.0, 0.0, along=True).accepted


def test_turns_on_the_spot_at_the_rate_asked_for(flying):
    place = flying.report.vehicle.position_enu_m
    error = abs(math.remainder(-2.0 - flying.report.vehicle.yaw_rad, math.tau))
    assert flying.ask(HeadingRequest(-2.0, 0.5)).accepted
    duration_s = flying.until(lambda r: abs(r.course.heading_error_rad) < 0.03)
    assert duration_s == pytest.approx(error / 0.5, abs=0.5)
    assert (flying.report.vehicle.position_enu_m - place).norm < 0.15
    assert flying.report.course.reference == "heading"


def test_hover_stops_within_the_braking_distance(flying):
    flying.go(30.0, 0.0, speed=3.0)
    flying.until(lambda r: r.vehicle.position_enu_m.x > 10.0)
    at_m = flying.vehicle.enu[0]
    speed_m_s = flying.report.vehicle.velocity_enu_m_s.x
    flying.ask(HoverRequest())
    flying.until(lambda r: r.vehicle.velocity_enu_m_s.norm < 0.05)
    assert flying.vehicle.enu[0] - at_m < speed_m_s**2 / 3.0 + 0.5
    flying.run(1.0)
    assert flying.report.course.remaining_enu_m.norm < 0.15


def test_lands_keeps_the_authority_and_can_take_off_again(flying):
    assert flying.agreed(LandRequest()).accepted
    flying.run(1.2)
    assert flying.report.authority
    flying.until(lambda r: not r.vehicle.armed)
    report = flying.report
    assert (report.course.reference, report.authority, report.course.remaining_enu_m, report.course.still_s) == ("land", True, Vec3(), 0.0)
    assert flying.ask(LandRequest()).reason == "on the ground already"
    assert flying.ask(HoverRequest()).reason == "not in the air"
    flying.take_off(4.0)
    assert flying.vehicle.enu[2] == pytest.approx(4.0, abs=0.15)


def test_landing_interrupted_by_hover_goes_back_to_guided(flying):
    flying.agreed(LandRequest())
    flying.until(lambda r: r.vehicle.position_enu_m.z < 2.0)
    assert flying.agreed(HoverRequest()).accepted
    flying.run(3.0)
    assert flying.report.course.reference == "hover"
    assert flying.vehicle.enu[2] > 1.0
    assert flying.vehicle.body.mode == GUIDED


@pytest.mark.parametrize("height_m", [1.1, 0.3, 0.02])
def test_a_landing_is_not_broken_off_near_the_ground(flying, height_m):
    landing = flying.agreed(LandRequest())
    flying.until(lambda _: flying.vehicle.enu[2] < height_m)
    refused = flying.ask(HoverRequest())
    assert not refused.accepted
    assert "landing" in refused.reason
    lowest_m = flying.vehicle.enu[2]
    flying.until(lambda r: not r.vehicle.armed)
    assert flying.vehicle.enu[2] <= lowest_m
    assert (flying.report.course.reference, flying.report.reference_id) == ("land", landing.reference_id)


def test_who_stops_it_lets_a_landing_go_on_and_anything_else_hover(flying):
    flying.go(10.0, 0.0)
    assert flying.agreed(StopRequest()).accepted
    assert flying.report.course.reference == "hover"
    landing = flying.agreed(LandRequest())
    flying.run(1.0)
    stopped = flying.ask(StopRequest())
    assert (stopped.accepted, stopped.procedure, stopped.reference_id) == (True, None, landing.reference_id)
    again = flying.ask(LandRequest())
    assert (again.accepted, again.procedure, again.reference_id) == (True, None, landing.reference_id)
    flying.until(lambda r: not r.vehicle.armed)
    assert flying.report.course.reference == "land"
    assert flying.ask(StopRequest()).accepted, "on the ground there is nothing to end"


def test_who_stops_it_before_lift_off_gives_the_take_off_up(flight):
    flight.until(lambda r: r.authority)
    flight.agreed(TakeoffRequest(3.0, 1.5))
    flight.run(1.0)
    assert flight.agreed(StopRequest()).accepted
    flight.run(5.0)
    assert (flight.vehicle.body.armed, flight.report.course.reference) == (False, "idle")


def test_still_counts_when_something_holds_the_vehicle(flying):
    flying.go(10.0, 0.0)
    flying.run(3.0)
    flying.vehicle.stuck = True
    flying.until(lambda r: r.course.still_s > 5.0, 7.0)
    flying.vehicle.stuck = False
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    flying.run(20.0)
    assert flying.report.course.still_s == 0.0


def test_restarted_in_the_air_it_hovers_and_commands_nothing(flying):
    flying.go(20.0, 0.0)
    old_id = flying.report.reference_id
    flying.run(4.0)
    commands = list(flying.commands)
    flying.guidance = Guidance(GuidanceSettings())
    flying.until(lambda r: r.course.reference == "hover", 1.5)
    assert flying.report.authority
    flying.run(3.0)
    assert flying.commands == commands
    assert flying.report.vehicle.velocity_enu_m_s.norm < 0.05
    assert flying.go(0.0, 0.0).reference_id > old_id
