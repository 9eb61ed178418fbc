"""A landing that does not end: the vehicle lies on the ground, the autopilot takes it for flying, and its motors are on."""

from __future__ import annotations

import pytest
from guidance_fake_autopilot import GUIDED, LAND, LOITER
from guidance_pure_flight import PureFlight

from uav_guidance.requests import LandRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.standing import STANDS_S

ARM_DISARM = "MAV_CMD_COMPONENT_ARM_DISARM"


def disarmings(flight):
    return [entry[2] for entry in flight.vehicle.transcript if entry[0] == ARM_DISARM and not entry[1]]


def lying(settings=None, height_m=0.1):
    """Return a flight whose landing has ended hard at a height, without the autopilot's knowing."""
    flight = PureFlight(settings)
    flight.take_off()
    assert flight.agreed(LandRequest()).accepted
    flight.until(lambda r: r.vehicle.position_enu_m.z < height_m)
    flight.vehicle.stuck = True
    return flight


def test_a_vehicle_that_lies_on_the_ground_with_its_motors_on_is_told_of_and_disarmed_first_politely_then_by_force():
    flight = lying()
    needed_s = flight.until(lambda r: not r.vehicle.armed, 30.0)
    assert needed_s > STANDS_S
    assert disarmings(flight) == [0.0, 21196.0]
    assert flight.report.course.reference == "land", "the landing ends as any other"
    assert flight.guidance.take_notes() == [
        "the vehicle stands still in LAND with its motors on, 0.1 m above home: it is disarmed",
        "disarm failed",
        "the vehicle stands still in LAND with its motors on, 0.1 m above home: it is disarmed",
        "its motors are off",
    ]
    assert flight.guidance.take_notes() == []


@pytest.mark.parametrize("settings", [GuidanceSettings(disarm_standing=False), None])
def test_what_is_not_allowed_or_lies_higher_than_the_ground_is_told_of_only(settings):
    flight = lying(settings, 0.1 if settings else 1.5)
    flight.run(20.0)
    assert flight.report.vehicle.armed
    assert disarmings(flight) == []
    (note,) = flight.guidance.take_notes()
    assert note.endswith(f"{flight.report.vehicle.position_enu_m.z:.1f} m above home: it is not disarmed by itself")


def test_a_landing_that_sinks_is_left_to_the_autopilot():
    flight = PureFlight()
    flight.take_off(8.0)
    assert flight.agreed(LandRequest()).accepted
    flight.until(lambda r: not r.vehicle.armed)
    assert (disarmings(flight), flight.guidance.take_notes()) == ([], [])


@pytest.mark.parametrize("mode", [LOITER, LAND])
def test_a_vehicle_that_the_pilot_has_keeps_its_motors(mode):
    flight = PureFlight()
    flight.take_off()
    flight.vehicle.body.place[2] = -0.1
    flight.vehicle.pilot(mode)
    flight.vehicle.stuck = True
    flight.run(20.0)
    assert disarmings(flight) == []


def test_a_vehicle_that_hovers_for_the_companion_keeps_its_motors():
    flight = PureFlight()
    flight.take_off()
    flight.run(20.0)
    assert flight.vehicle.body.mode == GUIDED
    assert disarmings(flight) == []
