"""How the companion comes to the authority: what the autopilot's readiness is worth, its restarts on the ground, a link that comes back."""

from __future__ import annotations

from guidance_fake_autopilot import GUIDED, STABILIZE

from uav_guidance.requests import HoverRequest, LandRequest

TAKE_GUIDED = ("MAV_CMD_DO_SET_MODE", 1.0, GUIDED, 0.0)
POSITION = {"LOCAL_POSITION_NED"}


def available(flight):
    return flight.guidance.resources().get("SDK_authority") == "AVAILABLE"


def times_available(flight, duration_s):
    """Fly on; return how often the authority was of use to the skills."""
    count, end_s = 0, flight.now_s + duration_s
    while flight.now_s < end_s:
        flight.tick()
        count += available(flight)
    return count


def test_readiness_told_before_guided_was_taken_does_not_count(flight):
    # In STABILIZE the checks need no position; in GUIDED they fail again, which the autopilot notes a second later.
    flight.vehicle._booted_s = flight.now_s
    flight.vehicle.position_check_s = 20.0
    flight.until(lambda r: r.vehicle.mode == GUIDED, 5.0)
    assert times_available(flight, 14.0) == 0
    flight.until(lambda _: available(flight), 10.0)
    assert flight.vehicle.ready


def test_an_autopilot_that_restarts_before_the_flight_is_noticed_without_a_position_and_taken_again(flight, said):
    flight.until(lambda _: available(flight), 10.0)
    flight.vehicle.restart(STABILIZE)
    flight.withheld = POSITION
    assert times_available(flight, 1.0) == 0
    flight.until(lambda r: r.vehicle.boots == 2 and r.vehicle.mode == GUIDED, 6.0)
    assert not flight.report.vehicle.located, "the place of before does not hold"
    assert times_available(flight, 10.0) == 0
    flight.withheld = set()
    flight.until(lambda _: available(flight), 4.0)
    assert flight.commands == [TAKE_GUIDED, TAKE_GUIDED]
    assert "the autopilot has restarted" in " ".join(said())


def test_after_a_flight_a_restart_is_left_to_the_operator(flying):
    assert flying.agreed(LandRequest()).accepted
    flying.until(lambda r: not r.vehicle.armed)
    flying.run(1.0)
    commands = list(flying.commands)
    flying.vehicle.restart(STABILIZE)
    flying.until(lambda r: r.vehicle.boots == 2, 5.0)
    flying.run(10.0)
    assert flying.commands == commands
    assert not available(flying)


def test_a_link_that_is_back_tells_nothing_of_the_mode_before_the_next_heartbeat(flying):
    flying.cut = True
    flying.until(lambda r: not r.authority, 4.0)
    flying.cut, flying.withheld = False, {"HEARTBEAT"}
    flying.run(3.0)
    assert not flying.report.link, "the mode that was heard last would be taken for the pilot's"
    assert not flying.report.authority
    assert "the autopilot has not told its mode yet" in flying.ask(HoverRequest()).reason
    flying.withheld = set()
    flying.until(lambda r: r.authority, 1.5)
    assert flying.report.link
