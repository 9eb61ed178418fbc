"""Who has the vehicle when the companion has not: told in the autopilot's words; what is no ArduPilot multicopter is left alone."""

from __future__ import annotations

import pytest
from guidance_fake_autopilot import GUIDED, LAND, LOITER, STABILIZE

from uav_guidance.requests import AuthorityRequest, HoverRequest, TakeoffRequest

RTL, BRAKE = 6, 17
QUADROTOR, FIXED_WING, HEXAROTOR, HELICOPTER, ROVER = 2, 1, 13, 4, 10
ARDUPILOT, PX4, GENERIC = 3, 12, 0


def reason(flight):
    return flight.guidance.reasons(flight.now_s)["SDK_authority"]


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ((QUADROTOR, PX4), "PX4 on a QUADROTOR"),
        ((QUADROTOR, GENERIC), "GENERIC on a QUADROTOR"),
        ((FIXED_WING, ARDUPILOT), "ARDUPILOTMEGA on a FIXED_WING"),
        ((ROVER, ARDUPILOT), "ARDUPILOTMEGA on a GROUND_ROVER"),
        ((HELICOPTER, ARDUPILOT), "ARDUPILOTMEGA on a HELICOPTER"),
        ((250, 251), "MAV_AUTOPILOT 251 on a MAV_TYPE 250"),
    ],
)
def test_what_is_no_ardupilot_multicopter_is_refused_by_name_and_sent_nothing(flight, kind, name):
    flight.vehicle.kind = kind
    flight.run(10.0)
    flight.vehicle.pilot(GUIDED)
    flight.run(10.0)
    words = f"the autopilot is {name}: only ArduPilot on a multicopter is flown"
    assert not flight.report.authority
    assert reason(flight) == words
    assert flight.ask(AuthorityRequest()).reason == words
    assert words in flight.ask(TakeoffRequest(3.0, 1.5)).reason
    assert flight.vehicle.transcript == []


@pytest.mark.parametrize("type_", [QUADROTOR, 3, HEXAROTOR, 14, 15, 29, 35])
def test_each_kind_of_multicopter_is_flown(flight, type_):
    flight.vehicle.kind = (type_, ARDUPILOT)
    flight.take_off()


@pytest.mark.parametrize("late_s", [0.0, 0.3, 1.8])
@pytest.mark.parametrize(("mode", "text", "severity"), [(RTL, "Radio Failsafe", 4), (BRAKE, "Circle fence breached", 5)])
def test_the_reason_is_what_the_autopilot_said_with_the_mode(flying, mode, text, severity, late_s):
    flying.vehicle.say(4, "said long before")
    flying.run(4.0)
    flying.vehicle.failsafe(mode, text, severity=severity, late_s=late_s)
    flying.run(2.5)
    name = {RTL: "RTL", BRAKE: "BRAKE"}[mode]
    assert reason(flying) == f"the vehicle is in {name}: {text}"
    flying.vehicle.say(4, "said long after")
    flying.run(1.0)
    assert reason(flying) == f"the vehicle is in {name}: {text}"


def test_a_text_just_before_the_mode_is_its_reason_and_infos_are_not(flying):
    flying.vehicle.say(2, "EKF Failsafe: changed to LAND Mode")
    flying.vehicle.say(6, "EKF3 IMU0 stopped aiding")
    flying.vehicle.say(2, "PreArm: GPS 1: bad fix")
    flying.run(1.0)
    flying.vehicle.pilot(LAND)
    flying.run(0.5)
    assert "the vehicle is in LAND: EKF Failsafe: changed to LAND Mode" in flying.ask(HoverRequest()).reason
    assert reason(flying) == "the vehicle is in LAND: EKF Failsafe: changed to LAND Mode"


def test_without_a_text_the_state_of_the_system_tells_a_failsafe_from_what_may_be_the_pilot(flying):
    flying.vehicle.system_status = 5
    flying.vehicle.pilot(RTL)
    flying.run(0.5)
    assert reason(flying) == "the vehicle is in RTL: a failsafe has it"
    flying.vehicle.system_status = 4
    flying.vehicle.pilot(LOITER)
    flying.run(0.5)
    assert reason(flying) == "the vehicle is in LOITER: the pilot or a failsafe has it"


def test_a_refused_arming_names_the_check_that_was_told_before(flight):
    flight.until(lambda r: r.authority and r.vehicle.ready)
    flight.vehicle.refuse_arming, flight.vehicle.says_why = "x", False
    flight.vehicle.say(2, "PreArm: Battery 1 below minimum arming voltage")
    decision = flight.agreed(TakeoffRequest(3.0, 1.5))
    assert decision.reason == "arm failed: Battery 1 below minimum arming voltage"
    flight.run(2.0)  # its checks are passed again
    assert flight.agreed(TakeoffRequest(3.0, 1.5)).reason == "arm failed"


def test_a_restart_in_the_air_is_told_as_one_also_where_the_mode_comes_first(flying):
    flying.withheld = {"ATTITUDE", "LOCAL_POSITION_NED", "EXTENDED_SYS_STATE"}
    flying.vehicle.restart(STABILIZE)
    flying.vehicle.body.armed = False
    flying.run(0.3)
    first = reason(flying)
    assert first == "the vehicle is in STABILIZE, disarmed in the air: the autopilot has restarted, or its motors were stopped"
    flying.withheld = set()
    flying.run(3.0)
    assert reason(flying) == "the autopilot has restarted, in STABILIZE"
