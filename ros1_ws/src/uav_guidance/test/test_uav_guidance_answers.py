"""Commands whose answers are lost, late or refused: what the vehicle is seen to do counts."""

from __future__ import annotations

import pytest
from guidance_fake_autopilot import GUIDED, LAND, LOITER
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_guidance.commands import ANSWER_S, ATTEMPTS, LIFT_OFF_S, Procedure, arm, disarm, set_mode, take_off
from uav_guidance.requests import AuthorityRequest, HoverRequest, LandRequest, TakeoffRequest
from uav_guidance.vehicle import Landed, Mode, VehicleSnapshot

HEARTBEAT, LANDED_STATE = "HEARTBEAT", "EXTENDED_SYS_STATE"
FAILED = 4
DONE = [
    (set_mode(Mode.GUIDED), HEARTBEAT, VehicleSnapshot(mode=Mode.STABILIZE), VehicleSnapshot(mode=Mode.GUIDED)),
    (set_mode(Mode.LAND), HEARTBEAT, VehicleSnapshot(mode=Mode.GUIDED), VehicleSnapshot(mode=Mode.LAND)),
    (arm(), HEARTBEAT, VehicleSnapshot(), VehicleSnapshot(armed=True)),
    (disarm(), HEARTBEAT, VehicleSnapshot(armed=True), VehicleSnapshot()),
    (take_off(3.0), LANDED_STATE, VehicleSnapshot(landed=Landed.ON_GROUND), VehicleSnapshot(landed=Landed.TAKING_OFF)),
]
NAMES = [command.name for command, *_ in DONE]


@pytest.mark.parametrize(("command", "kind", "before", "after"), DONE, ids=NAMES)
def test_what_is_seen_to_be_done_needs_no_answer(command, kind, before, after):
    procedure = Procedure([command])
    procedure.on_vehicle(kind, after)
    assert procedure.outcome is None, "not sent yet"
    assert procedure.due(0.0) is not None
    procedure.on_vehicle(kind, before)
    assert procedure.outcome is None
    procedure.on_vehicle("ATTITUDE", after)
    assert procedure.outcome is None, "another message does not tell it: what it tells was heard before"
    procedure.on_vehicle(kind, after)
    assert procedure.outcome is not None
    assert procedure.outcome.accepted


@pytest.mark.parametrize(("command", "kind", "before", "after"), DONE, ids=NAMES)
def test_a_refusal_of_what_is_done_already_is_none(command, kind, before, after):
    procedure = Procedure([command])
    procedure.due(0.0)
    procedure.on_answer(command.number, FAILED, 0.1)
    procedure.on_vehicle(kind, before)
    assert procedure.due(0.2) is None
    assert procedure.outcome is None
    procedure.on_vehicle(kind, after)
    assert procedure.outcome is not None
    assert procedure.outcome.accepted
    assert procedure.due(5.0) is None
    assert procedure.outcome.accepted


def test_a_take_off_is_given_up_when_it_could_have_lifted_off():
    procedure = Procedure([take_off(3.0)])
    sent = [now_s for step in range(400) if procedure.due(now_s := step * 0.05) is not None]
    assert sent == pytest.approx([attempt * ANSWER_S for attempt in range(ATTEMPTS)])
    assert procedure.outcome is not None
    assert procedure.outcome.reason == "take-off: the autopilot does not answer"
    procedure = Procedure([take_off(3.0)])
    for step in range(400):
        if step * 0.05 > sent[-1] + LIFT_OFF_S - 0.1:
            break
        procedure.due(step * 0.05)
    assert procedure.outcome is None


def test_a_whole_flight_without_any_answer(flight):
    flight.withheld = {"COMMAND_ACK"}
    flight.take_off()
    flight.go(5.0, 0.0)
    flight.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    flight.vehicle.pilot(LOITER)
    flight.until(lambda r: not r.authority, 2.0)
    assert flight.agreed(AuthorityRequest()).accepted
    flight.until(lambda r: r.course.reference == "hover", 2.0)
    assert flight.agreed(LandRequest()).accepted
    flight.until(lambda r: not r.vehicle.armed)
    assert flight.report.course.reference == "land"


def test_a_take_off_whose_repetition_is_refused_has_taken_off(flight):
    flight.until(lambda r: r.authority and r.vehicle.ready)
    flight.vehicle.lost_answers = {"MAV_CMD_NAV_TAKEOFF": 3}
    decision = flight.agreed(TakeoffRequest(3.0, 1.5))
    assert decision.accepted, decision.reason
    flight.until(lambda r: r.course.remaining_enu_m.norm < 0.1)
    assert flight.report.course.reference == "takeoff"


def test_hover_before_the_landing_was_seen_goes_back_to_guided(flying):
    assert flying.ask(LandRequest()).accepted
    assert flying.vehicle.body.mode == LAND
    assert flying.report.vehicle.mode == GUIDED, "no heartbeat has told it yet"
    decision = flying.agreed(HoverRequest())
    assert decision.accepted, decision.reason
    flying.run(5.0)
    assert flying.vehicle.body.mode == GUIDED
    assert flying.report.course.reference == "hover"
    assert flying.vehicle.enu[2] > 2.0


def test_a_landing_asked_for_before_guided_was_seen_lands(flying):
    assert flying.agreed(LandRequest()).accepted
    flying.until(lambda r: r.vehicle.mode == LAND)
    assert flying.ask(HoverRequest()).accepted
    assert flying.vehicle.body.mode == GUIDED
    assert flying.report.vehicle.mode == LAND, "no heartbeat has told it yet"
    assert flying.agreed(LandRequest()).accepted
    flying.until(lambda r: not (r.vehicle.armed and r.authority), 20.0)
    assert flying.report.authority
    assert flying.vehicle.body.mode == LAND


@pytest.mark.parametrize("told", [False, True])
def test_a_heartbeat_on_its_way_does_not_make_our_landing_the_pilots(flying, told):
    assert flying.agreed(LandRequest()).accepted
    flying.until(lambda r: r.vehicle.mode == LAND)
    assert flying.ask(HoverRequest()).accepted
    if told:
        flying.guidance.on_message(mavlink.MAVLink_heartbeat_message(13, 3, 129, LAND, 4, 3), flying.now_s)
    assert flying.ask(LandRequest()).accepted
    flying.guidance.on_message(mavlink.MAVLink_heartbeat_message(13, 3, 129, GUIDED, 4, 3), flying.now_s)
    flying.run(0.2)
    assert flying.report.authority
    assert flying.vehicle.body.mode == LAND


def test_a_landing_that_never_reached_the_autopilot_does_not_make_the_pilots_landing_ours(flying):
    flying.cut = True
    flying.ask(LandRequest())
    flying.cut = False
    assert flying.agreed(HoverRequest()).accepted
    flying.run(1.0)
    flying.vehicle.pilot(LAND)
    flying.until(lambda r: r.vehicle.mode == LAND, 1.0)
    flying.run(0.1)
    assert not flying.report.authority
    commands = list(flying.commands)
    assert not flying.ask(HoverRequest()).accepted
    flying.run(3.0)
    assert flying.commands == commands


def test_guided_that_is_refused_at_the_start_is_asked_for_again(flight):
    flight.vehicle.refuse_guided = True
    flight.run(20.0)
    assert 2 <= len(flight.commands) <= 5, "again, but not at every step"
    flight.vehicle.refuse_guided = False
    flight.until(lambda r: r.authority, 8.0)
    flight.vehicle.pilot(LOITER)
    flight.run(1.0)
    commands = list(flight.commands)
    flight.run(20.0)
    assert flight.commands == commands, "what the pilot has taken is not taken back"
