"""Whole flights of the pure state machine against a vehicle that behaves as the real autopilot was seen to."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from guidance_fake_autopilot import GUIDED, LAND, LOITER
from guidance_pure_flight import PureFlight

from uav_guidance.guidance import Guidance
from uav_guidance.obstacles import Sighting
from uav_guidance.requests import (
    AuthorityRequest,
    HeadingRequest,
    HoverRequest,
    LandRequest,
    PositionRequest,
    TakeoffRequest,
)
from uav_guidance.settings import Settings
from uav_guidance.vectors import Vec3

NAN = math.nan
MODE, ARM, TAKEOFF = "MAV_CMD_DO_SET_MODE", "MAV_CMD_COMPONENT_ARM_DISARM", "MAV_CMD_NAV_TAKEOFF"


@pytest.fixture
def flight():
    return PureFlight()


@pytest.fixture
def flying(flight):
    flight.take_off()
    return flight


# ---- authority


def test_guided_is_taken_once_when_the_vehicle_is_ready(flight):
    flight.run(0.9)
    assert flight.commands == []
    assert not flight.report.authority
    flight.until(lambda r: r.authority, 2.0)
    flight.run(5.0)
    assert flight.commands == [(MODE, 1.0, GUIDED, 0.0)]
    assert flight.guidance.resources() == {"SDK_authority": "AVAILABLE", "flight_status": "ON_GROUND", "homepoint_status": "VALID"}


def test_the_authority_is_of_use_once_there_is_a_position(flight):
    flight.withheld = {"LOCAL_POSITION_NED"}
    flight.until(lambda r: r.authority, 5.0)
    flight.run(10.0)
    assert flight.guidance.resources()["SDK_authority"] == "UNAVAILABLE"
    flight.withheld = set()
    flight.run(0.2)
    assert flight.guidance.resources()["SDK_authority"] == "AVAILABLE"


def test_checks_that_fail_again_on_the_ground_take_nothing_away(flight):
    flight.until(lambda r: r.authority and r.vehicle.ready)
    flight.run(0.2)
    flight.guidance.vehicle = replace(flight.guidance.vehicle, ready=False)
    flight.withheld = {"SYS_STATUS"}
    flight.run(1.0)
    assert flight.guidance.resources()["SDK_authority"] == "AVAILABLE"


def test_life_is_any_message(flying):
    flying.withheld = {"HEARTBEAT"}
    flying.run(5.0)
    assert flying.report.link
    assert flying.report.authority
    flying.cut = True
    lost_s = flying.until(lambda r: not r.link, 4.0)
    assert lost_s == pytest.approx(Settings().link_lost_s, abs=0.1)


def test_a_link_lost_is_told_from_a_take_over(flying, caplog):
    flying.vehicle.pilot(LOITER)
    flying.until(lambda r: not r.authority, 2.0)
    assert "the vehicle is in LOITER: the pilot or a failsafe has it" in flying.ask(HoverRequest()).reason
    flying.vehicle.pilot(GUIDED)
    flying.until(lambda r: r.authority, 2.0)
    flying.cut = True
    flying.until(lambda r: not r.authority, 4.0)
    assert "the link is lost, nothing was heard of the autopilot for 2." in flying.ask(HoverRequest()).reason
    assert [record.getMessage().split(":")[0] for record in caplog.records] == ["authority lost"] * 2


def test_spooling_up_is_no_lack_of_progress(flight):
    flight.until(lambda r: r.authority and r.vehicle.ready)
    assert flight.agreed(TakeoffRequest(3.0, 1.5)).accepted
    flight.until(lambda r: r.vehicle.landed == 3, 6.0)
    flight.run(0.1)
    assert flight.report.course.still_s < 0.2


def test_a_guidance_started_again_in_flight_reports_nothing_before_it_knows(flying):
    flying.guidance = Guidance(Settings())
    reported = []
    for _ in range(60):
        flying.run(0.05)
        reported.append(flying.guidance.resources())
    known = [states for states in reported if states]
    assert known, "in the end it knows"
    assert known[0] == known[-1] == {"SDK_authority": "AVAILABLE", "flight_status": "IN_AIR", "homepoint_status": "VALID"}


def test_a_guidance_without_a_vehicle_says_so_after_a_while():
    guidance = Guidance(Settings())
    guidance.step(10.0)
    assert guidance.resources() == {}
    guidance.step(10.0 + Settings().link_lost_s + 0.1)
    assert guidance.resources() == {"SDK_authority": "UNAVAILABLE", "homepoint_status": "INVALID"}


def test_guided_is_asked_for_again_only_while_nobody_answers(flight):
    flight.vehicle.deaf = True
    flight.run(12.0)
    assert flight.commands == []
    flight.vehicle.deaf = False
    flight.until(lambda r: r.authority, 6.0)
    assert len(flight.commands) == 1


def test_a_vehicle_that_the_pilot_has_armed_is_left_alone(flight):
    flight.vehicle.body.armed, flight.vehicle._armed_s = True, flight.now_s
    flight.vehicle.body.mode = LOITER
    flight.run(20.0)  # it disarms itself on the ground meanwhile
    assert not flight.vehicle.body.armed
    assert flight.commands == []


def test_pilot_takes_over_and_the_reference_is_dropped_within_a_heartbeat(flying):
    flying.go(20.0, 0.0)
    flying.run(3.0)
    sent = len(flying.vehicle.transcript)
    flying.vehicle.pilot(LOITER)
    assert flying.until(lambda r: not r.authority) <= 0.2
    assert flying.report.course.reference == "idle"
    assert flying.guidance.resources()["SDK_authority"] == "UNAVAILABLE"
    flying.run(30.0)
    assert len(flying.vehicle.transcript) == sent
    for request in (TakeoffRequest(3.0, 1.0), HoverRequest(), LandRequest(), PositionRequest(Vec3(1, 0, 3), 1, along_travel=False)):
        decision = flying.ask(request)
        assert not decision.accepted
        assert "LOITER" in decision.reason
    assert len(flying.vehicle.transcript) == sent


def test_pilots_own_landing_is_not_the_companions(flying):
    flying.vehicle.pilot(LAND)
    flying.run(0.1)
    assert not flying.report.authority


def test_operator_gives_the_authority_back_and_it_hovers_there(flying):
    flying.vehicle.pilot(LOITER)
    flying.run(1.0)
    assert flying.agreed(AuthorityRequest()).accepted
    flying.until(lambda r: r.authority and r.course.reference == "hover", 1.5)
    place = flying.report.vehicle.position_enu_m
    flying.run(3.0)
    assert (flying.report.vehicle.position_enu_m - place).norm < 0.2


def test_lost_link_takes_the_authority_and_a_new_one_makes_it_hover(flying):
    flying.go(20.0, 0.0)
    flying.run(3.0)
    flying.cut = True
    assert 1.0 <= flying.until(lambda r: not r.link) <= 2.1
    flying.run(0.1)
    assert not flying.report.authority
    assert flying.report.course.reference == "idle"
    flying.cut = False
    flying.until(lambda r: r.authority, 1.5)
    assert flying.report.course.reference == "hover"


# ---- take-off


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


def test_deaf_autopilot_is_given_up_after_four_attempts(flight):
    flight.until(lambda r: r.authority)
    flight.vehicle.deaf = True
    decision = flight.agreed(TakeoffRequest(3.0, 1.5))
    assert decision.reason == "arm: the autopilot does not answer"


# ---- position, heading, hover, land


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
    flying.guidance = Guidance(Settings())
    flying.until(lambda r: r.course.reference == "hover", 1.5)
    assert flying.report.authority
    flying.run(3.0)
    assert flying.commands == commands
    assert flying.report.vehicle.velocity_enu_m_s.norm < 0.05
    assert flying.go(0.0, 0.0).reference_id > old_id


# ---- refusals


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        (PositionRequest(Vec3(61.0, 0.0, 3.0), 1.0, along_travel=False), "outside the fence: 61.0 m from home, at most 60 m are allowed"),
        (PositionRequest(Vec3(1.0, 0.0, 20.5), 1.0, along_travel=False), "outside the fence: 20.50 m above home, 0.5 to 20 m are allowed"),
        (PositionRequest(Vec3(1.0, 0.0, 0.4), 1.0, along_travel=False), "outside the fence: 0.40 m above home, 0.5 to 20 m are allowed"),
        (PositionRequest(Vec3(NAN, 0.0, 3.0), 1.0, along_travel=False), "target (nan, 0.0, 3.0): not a number"),
        (PositionRequest(Vec3(1.0, 0.0, 3.0), NAN, along_travel=False), "speed is nan: not a number"),
        (PositionRequest(Vec3(1.0, 0.0, 3.0), 0.0, along_travel=False), "speed is 0: it must be positive"),
        (PositionRequest(Vec3(1.0, 0.0, 3.0), 5.1, along_travel=False), "speed is 5.1: at most 5 is allowed"),
        (HeadingRequest(math.inf, 0.5), "yaw is inf: not a number"),
        (HeadingRequest(1.0, -0.5), "rate is -0.5: it must be positive"),
        (HeadingRequest(1.0, 2.0, lock=True), "rate is 2: at most 1.5 is allowed"),
        (TakeoffRequest(3.0, 1.0), "not on the ground"),
        (TakeoffRequest(NAN, 1.0), "height is nan: not a number"),
        (TakeoffRequest(25.0, 1.0), "outside the fence: 25.00 m above home, 0.5 to 20 m are allowed"),
        (TakeoffRequest(3.0, -1.0), "speed is -1: it must be positive"),
    ],
)
def test_refusals_in_the_air_change_nothing(flying, request_, reason):
    before = flying.report
    decision = flying.guidance.ask(request_, flying.now_s)
    assert (decision.accepted, decision.reason) == (False, reason)
    assert flying.report == before


@pytest.mark.parametrize(
    "request_", [PositionRequest(Vec3(1.0, 0.0, 3.0), 1.0, along_travel=False), HeadingRequest(1.0, 0.5), HoverRequest()]
)
def test_refusals_on_the_ground(flight, request_):
    flight.until(lambda r: r.authority)
    assert flight.ask(request_).reason == "not in the air"


def test_without_home_there_is_no_fence_and_nothing_inside():
    guidance = Guidance(Settings())
    assert guidance.fence_reason(Vec3(1.0, 0.0, 3.0)) == "home is not known yet, so the fence is not"
    assert guidance.ask(HoverRequest(), 0.0).reason == "no authority: nothing was heard of the autopilot"


def test_take_off_of_a_vehicle_that_is_not_ready_says_why(flight):
    flight.until(lambda r: r.authority)
    flight.vehicle._ready_from_s = math.inf
    flight.until(lambda r: not r.vehicle.ready)
    flight.guidance.on_text(2, "PreArm: Compass not healthy")
    assert flight.ask(TakeoffRequest(3.0, 1.0)).reason == "the autopilot is not ready: Compass not healthy"


# ---- obstacles


def see(flight: PureFlight, obstacle_x: float | None, source: str = "zed", **other: object) -> None:
    x, y, z = flight.vehicle.enu
    away = math.inf if obstacle_x is None else obstacle_x - x
    sighting = Sighting(source, flight.now_s, obstacle_x is not None, away, Vec3(obstacle_x or 0.0, y, z), **other)
    flight.guidance.on_obstacle(sighting, flight.now_s)


def watch(flight: PureFlight, duration_s: float, obstacle_x: float | None = None, source: str = "zed", **other: object) -> None:
    """Fly on with a sensor's verdict at 10 Hz."""
    for _ in range(round(duration_s * 10)):
        see(flight, obstacle_x, source, **other)
        flight.run(0.1)


def test_brakes_before_an_obstacle_and_goes_on_when_it_is_gone(flying):
    flying.go(15.0, 0.0, speed=1.5)
    while not flying.report.course.obstacle_stop:
        see(flying, 8.0)
        flying.tick()
    assert 2.8 <= flying.report.course.obstacle_m <= 3.2
    while flying.report.course.still_s < 5.0:
        see(flying, 8.0)
        flying.tick()
    assert 8.0 - flying.vehicle.enu[0] > 1.9
    gone_from_s = flying.now_s
    while flying.report.course.obstacle_stop:
        see(flying, None)
        flying.tick()
    assert flying.now_s - gone_from_s == pytest.approx(0.5, abs=0.1)
    watch(flying, 12.0)
    assert flying.report.course.remaining_enu_m.norm < 0.1


def test_what_is_behind_the_target_or_aside_does_not_stop_it(flying):
    flying.go(5.0, 0.0)
    while flying.report.course.remaining_enu_m.norm > 0.2:
        see(flying, 7.3)
        flying.tick()
        assert not flying.report.course.obstacle_stop
    place = Vec3(*flying.vehicle.enu)
    flying.go(5.0, 8.0)
    while flying.report.course.remaining_enu_m.norm > 4.0:
        aside = Sighting("zed", flying.now_s, True, 2.0, Vec3(*flying.vehicle.enu) + Vec3(2.0, 0.0, 0.0))
        flying.guidance.on_obstacle(aside, flying.now_s)
        flying.tick()
        assert not flying.report.course.obstacle_stop
    assert place.x == pytest.approx(5.0, abs=0.3)


def braking_begins_s(flight: PureFlight, limit_s: float = 2.0) -> float:
    """Return how long the setpoints still move on, or fail."""
    begin_s = flight.now_s
    place = flight.setpoints[-1][1].position_enu_m
    while flight.now_s - begin_s < limit_s:
        flight.tick()
        if flight.report.course.obstacle_stop:
            return flight.now_s - begin_s
    pytest.fail(f"flies on: {flight.setpoints[-1][1].position_enu_m} after {place}")


def test_brakes_within_0_3_s_when_nobody_watches_any_more_and_goes_on_when_somebody_does(flying):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 4.0)
    see(flying, None)
    assert braking_begins_s(flying) <= 0.3
    assert flying.report.course.unwatched
    flying.run(3.0)
    stopped_x = flying.vehicle.enu[0]
    flying.run(3.0)
    assert flying.vehicle.enu[0] == pytest.approx(stopped_x, abs=0.05), "it stays until somebody watches"
    watch(flying, 2.0, source="lidar")
    assert not flying.report.course.obstacle_stop
    assert flying.vehicle.enu[0] > stopped_x + 1.0


def test_an_obstacle_that_nobody_sees_any_more_is_not_forgotten(flying):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 3.0)
    watch(flying, 1.0, flying.vehicle.enu[0] + 3.5)
    flying.run(10.0)
    assert flying.report.course.obstacle_stop
    assert flying.report.course.obstacle_m == math.inf


def test_a_way_that_can_not_be_judged_is_not_free(flying):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 3.0)
    see(flying, None, unknown=True)
    flying.tick()
    flying.run(0.05)
    assert flying.report.course.obstacle_stop
    watch(flying, 1.0, unknown=True)
    assert flying.report.course.obstacle_stop
    see(flying, None, "lidar")
    flying.run(0.1)
    assert not flying.report.course.obstacle_stop, "one that can judge is enough"


@pytest.mark.parametrize("stamp_s", [lambda now_s: now_s - 0.7, lambda now_s: now_s + 10.0, lambda _: 1.0, lambda _: math.nan])
def test_a_verdict_on_an_old_or_a_future_measurement_is_none(flying, stamp_s):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 3.0)
    for _ in range(5):
        flying.guidance.on_obstacle(Sighting("zed", stamp_s(flying.now_s), False, math.inf), flying.now_s)
        flying.run(0.1)
    assert flying.report.course.obstacle_stop
    watch(flying, 0.2)
    assert not flying.report.course.obstacle_stop, "a wrong stamp does no harm to the right ones after it"


def test_where_nobody_has_watched_in_this_flight_it_flies_unwatched(flying):
    flying.go(3.0, 0.0)
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.2)
    watch(flying, 1.0)
    flying.run(1.0)
    assert flying.report.course.unwatched
    flying.agreed(LandRequest())
    flying.until(lambda r: not r.vehicle.armed)
    flying.run(0.2)
    assert not flying.report.course.unwatched, "the next flight begins anew"


def test_standing_vehicle_is_not_stopped(flying):
    see(flying, flying.vehicle.enu[0] + 1.0)
    flying.run(0.2)
    assert not flying.report.course.obstacle_stop
    assert flying.report.course.obstacle_m == pytest.approx(1.0, abs=0.1)
