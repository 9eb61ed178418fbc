"""The authority over the vehicle: taken once, lost to the pilot or with the link, given back."""

from __future__ import annotations

from dataclasses import replace

import pytest
from guidance_fake_autopilot import GUIDED, LAND, LOITER, STABILIZE

from uav_guidance.guidance import Guidance
from uav_guidance.requests import AuthorityRequest, HoverRequest, LandRequest, PositionRequest, TakeoffRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Vec3

MODE, ARM, TAKEOFF = "MAV_CMD_DO_SET_MODE", "MAV_CMD_COMPONENT_ARM_DISARM", "MAV_CMD_NAV_TAKEOFF"


def test_guided_is_taken_once_when_the_vehicle_is_ready(flight):
    flight.run(0.9)
    assert flight.commands == []
    assert not flight.report.authority
    flight.until(lambda r: r.authority, 2.0)
    flight.run(5.0)
    assert flight.commands == [(MODE, 1.0, GUIDED, 0.0)]
    assert flight.guidance.resources() == {
        "SDK_authority": "AVAILABLE",
        "flight_status": "ON_GROUND",
        "homepoint_status": "VALID",
        "position_status": "KNOWN",
    }


def test_the_authority_is_of_use_once_there_is_a_position(flight):
    flight.withheld = {"LOCAL_POSITION_NED"}
    flight.until(lambda r: r.authority, 5.0)
    flight.run(10.0)
    assert flight.guidance.resources()["SDK_authority"] == "UNAVAILABLE"
    flight.withheld = set()
    flight.run(0.2)
    assert flight.guidance.resources()["SDK_authority"] == "AVAILABLE"


def test_checks_that_fail_again_on_the_ground_take_nothing_away(flight):
    flight.until(lambda _: flight.guidance.resources().get("SDK_authority") == "AVAILABLE")
    flight.guidance.odometry = replace(flight.guidance.odometry, ready=False)
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
    assert lost_s == pytest.approx(GuidanceSettings().link_lost_s, abs=0.1)


def test_a_link_lost_is_told_from_a_take_over(flying, said):
    flying.vehicle.pilot(LOITER)
    flying.until(lambda r: not r.authority, 2.0)
    assert "the vehicle is in LOITER: the pilot or a failsafe has it" in flying.ask(HoverRequest()).reason
    flying.vehicle.pilot(GUIDED)
    flying.until(lambda r: r.authority, 2.0)
    flying.cut = True
    flying.until(lambda r: not r.authority, 4.0)
    assert "the link to the autopilot is lost, nothing was heard of it for 2." in flying.ask(HoverRequest()).reason
    assert [words.split(":")[0] for words in said()] == ["authority lost"] * 2


def test_spooling_up_is_no_lack_of_progress(flight):
    flight.until(lambda r: r.authority and r.vehicle.ready)
    assert flight.agreed(TakeoffRequest(3.0, 1.5)).accepted
    flight.until(lambda r: r.vehicle.landed == 3, 6.0)
    flight.run(0.1)
    assert flight.report.course.still_s < 0.2


def test_a_guidance_started_again_in_flight_reports_nothing_before_it_knows(flying):
    flying.guidance = Guidance(GuidanceSettings())
    reported = []
    for _ in range(60):
        flying.run(0.05)
        reported.append(flying.guidance.resources())
    known = [states for states in reported if states]
    assert known, "in the end it knows"
    assert (
        known[0]
        == known[-1]
        == {"SDK_authority": "AVAILABLE", "flight_status": "IN_AIR", "homepoint_status": "VALID", "position_status": "KNOWN"}
    )


def test_a_guidance_without_a_vehicle_says_so_after_a_while():
    guidance = Guidance(GuidanceSettings())
    guidance.step(10.0)
    assert guidance.resources() == {}
    guidance.step(10.0 + GuidanceSettings().link_lost_s + 0.1)
    assert guidance.resources() == {"SDK_authority": "UNAVAILABLE", "homepoint_status": "INVALID"}


def test_guided_is_asked_for_again_only_while_no_answer_comes(flight):
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


def test_an_autopilot_that_restarts_in_guided_is_told_held_in_place_and_can_be_landed(flying, said):
    flying.go(20.0, 0.0)
    flying.run(3.0)
    flying.vehicle.restart(GUIDED)
    flying.until(lambda r: r.vehicle.boots == 2, 4.0)
    assert said() == ["the autopilot has restarted, in GUIDED"]
    flying.until(lambda r: r.course.reference == "hover", 3.0)
    place = flying.report.vehicle.position_enu_m
    flying.run(3.0)
    assert (flying.report.vehicle.position_enu_m - place).norm < 0.5
    assert flying.guidance.resources()["SDK_authority"] == "UNAVAILABLE", "places may be others now"
    assert flying.report.authority
    assert flying.agreed(LandRequest()).accepted
    flying.until(lambda r: not r.vehicle.armed)
    flying.run(0.2)
    assert flying.guidance.resources()["SDK_authority"] == "AVAILABLE", "for another flight"


def test_an_autopilot_that_restarts_in_another_mode_is_told_from_the_pilot_and_gets_no_command(flying):
    flying.go(20.0, 0.0)
    flying.run(3.0)
    commands = list(flying.commands)
    flying.vehicle.restart(STABILIZE)
    flying.until(lambda r: r.vehicle.boots == 2, 4.0)
    assert flying.guidance.resources()["SDK_authority"] == "UNAVAILABLE"
    assert flying.ask(HoverRequest()).reason == "no authority: the autopilot has restarted, in STABILIZE"
    flying.run(5.0)
    assert flying.commands == commands
    assert flying.agreed(AuthorityRequest()).accepted
    flying.until(lambda r: r.authority and r.course.reference == "hover", 2.0)
    assert flying.guidance.resources()["SDK_authority"] == "AVAILABLE"
    flying.vehicle.pilot(LOITER)
    flying.until(lambda r: not r.authority, 1.0)
    assert "the pilot or a failsafe has it" in flying.ask(HoverRequest()).reason


def test_the_authority_is_reported_with_what_has_the_vehicle(flying):
    def reason() -> str:
        return flying.guidance.reasons(flying.now_s).get("SDK_authority", "")

    assert reason() == ""
    flying.vehicle.pilot(LOITER)
    flying.until(lambda r: not r.authority, 2.0)
    assert reason() == "the vehicle is in LOITER: the pilot or a failsafe has it"
    flying.cut = True
    flying.until(lambda r: not r.link, 4.0)
    flying.run(2.0)
    assert reason() == "the link to the autopilot is lost", "words that stay as long as nothing changes"
    flying.cut = False
    flying.vehicle.restart(STABILIZE)
    flying.until(lambda r: r.vehicle.boots == 2, 4.0)
    assert reason() == "the autopilot has restarted, in STABILIZE"
