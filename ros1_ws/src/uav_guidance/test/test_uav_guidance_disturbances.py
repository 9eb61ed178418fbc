"""What befalls the autopilot in flight: its estimator jumps, wind pushes, a failsafe takes over, another mode at the start."""

from __future__ import annotations

import math

import pytest
from guidance_fake_autopilot import GUIDED, LAND
from guidance_pure_flight import PureFlight

from uav_guidance.requests import HeadingRequest, HoverRequest, LandRequest, PositionRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Vec3

RTL = 6
LEAD_M = GuidanceSettings().lead_m(1.5)


def farthest_setpoint_m(flight: PureFlight, duration_s: float) -> float:
    """Fly on; return how far a setpoint ever was from where the vehicle was said to be, metres."""
    flight.setpoints.clear()
    farthest_m, end_s = 0.0, flight.now_s + duration_s
    while flight.now_s < end_s:
        sent = len(flight.setpoints)
        flight.tick()
        for _, setpoint in flight.setpoints[sent:]:
            farthest_m = max(farthest_m, (setpoint.position_enu_m - Vec3(*flight.vehicle.enu)).norm)
    assert flight.setpoints
    return farthest_m


@pytest.mark.parametrize("jump_ned_m", [(5.0, 0.0, 0.0), (0.0, -5.0, 0.0), (0.0, 0.0, 1.5)])
@pytest.mark.parametrize(
    "request_",
    [PositionRequest(Vec3(20.0, 0.0, 3.0), 1.5, along_travel=True), HoverRequest(), HeadingRequest(1.0, 0.5)],
    ids=["position", "hover", "heading"],
)
def test_an_estimate_that_jumps_moves_no_setpoint_away_from_the_vehicle(flying, request_, jump_ned_m, said):
    # A GPS glitch: ArduCopter would fly back at its own top speed, to a place that was wrong before or is wrong now.
    assert flying.ask(request_).accepted
    flying.run(4.0)
    for axis, step_m in enumerate(jump_ned_m):
        flying.vehicle.body.place[axis] += step_m
    assert farthest_setpoint_m(flying, 3.0) < LEAD_M + 0.3
    assert sum("has jumped" in words for words in said()) == 1


def test_a_small_step_of_the_estimate_is_flown_back(flying):
    flying.ask(HoverRequest())
    flying.run(1.0)
    place = flying.report.vehicle.position_enu_m
    flying.vehicle.body.place[0] += 0.4
    flying.run(4.0)
    assert (flying.report.vehicle.position_enu_m - place).norm < 0.1


def test_a_pause_of_the_telemetry_is_no_jump(flying, said):
    flying.go(30.0, 0.0, speed=3.0)
    flying.run(4.0)
    flying.withheld = {"LOCAL_POSITION_NED"}
    flying.run(1.8)
    flying.withheld = set()
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    assert said() == []
    assert flying.report.course.reference == "position"


def test_wind_that_pushes_a_hovering_vehicle_is_countered(flying):
    flying.ask(HoverRequest())
    flying.run(2.0)
    held = flying.report.course.target_enu_m
    for _ in range(500):
        flying.tick()
        flying.vehicle.body.place[1] += 0.3 * 0.02
    assert flying.report.course.target_enu_m == held
    assert (Vec3(*flying.vehicle.enu) - held).norm < 0.5
    assert flying.report.course.still_s == 0.0


@pytest.mark.parametrize("mode", [RTL, LAND])
def test_a_failsafe_of_the_autopilot_itself_is_left_alone(flying, mode):
    flying.go(20.0, 0.0)
    flying.run(2.0)
    commands = list(flying.commands)
    flying.vehicle.pilot(mode)
    assert flying.until(lambda r: not r.authority) <= 0.2
    setpoints = len(flying.setpoints)
    flying.run(10.0)
    assert flying.commands == commands
    assert len(flying.setpoints) == setpoints
    assert flying.guidance.resources()["SDK_authority"] == "UNAVAILABLE"


@pytest.mark.parametrize("mode", [3, RTL, LAND, 17])
def test_whatever_mode_it_wakes_up_in_guided_is_taken_once_it_is_ready(flight, mode):
    flight.vehicle.body.mode = mode
    flight.until(lambda r: r.authority and r.vehicle.mode == GUIDED, 5.0)
    flight.take_off()
    assert flight.vehicle.body.mode == GUIDED
    assert flight.vehicle.enu[2] > 2.5


def test_an_autopilot_that_is_ready_late_gets_its_take_off_late(flight):
    flight.vehicle._ready_from_s = flight.now_s + 20.0
    flight.run(19.0)
    assert flight.commands == []
    assert flight.guidance.resources()["SDK_authority"] == "UNAVAILABLE"
    flight.take_off()


def test_a_heading_that_jumps_turns_the_vehicle_at_the_rate_of_its_reference(flying):
    flying.ask(HoverRequest())
    flying.run(2.0)
    flying.vehicle.body.yaw += math.radians(20.0)
    assert farthest_setpoint_m(flying, 3.0) < 0.3
    assert flying.report.course.reference == "hover"


@pytest.mark.parametrize("silent", [{"LOCAL_POSITION_NED"}, {"ATTITUDE"}, {"LOCAL_POSITION_NED", "ATTITUDE"}])
def test_a_place_that_is_not_told_any_more_makes_no_setpoint(flying, silent):
    # An estimator without a position, or streams that another client has reset; heartbeats and the landed state go on.
    flying.go(20.0, 0.0)
    flying.run(3.0)
    flying.withheld = silent
    flying.run(2.2)
    sent = len(flying.setpoints)
    flying.run(5.0)
    assert len(flying.setpoints) == sent
    for request in (HoverRequest(), PositionRequest(Vec3(1.0, 0.0, 3.0), 1.0, along_travel=False)):
        assert flying.ask(request).reason == "the autopilot does not say where it is"
    flying.withheld = set()
    assert farthest_setpoint_m(flying, 3.0) < LEAD_M + 0.3
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.1)


def test_a_vehicle_that_does_not_know_its_place_can_be_landed(flying):
    flying.withheld = {"LOCAL_POSITION_NED"}
    flying.run(3.0)
    assert flying.agreed(LandRequest()).accepted
    flying.until(lambda r: not r.vehicle.armed)
