"""Whether the autopilot knows where it is: the GPS that is lost, before the estimator gives its position up."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_guidance.positioning import BACK_S, Positioning
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vehicle import VehicleSnapshot

LOST_S = GuidanceSettings().position_lost_s
WITHOUT_POSITION = 167  # attitude, velocities, height, constant position


def status(flight):
    return flight.guidance.resources().get("position_status")


def why(flight):
    return flight.guidance.reasons(flight.now_s).get("position_status", "")


@pytest.mark.parametrize(
    ("fix", "said"), [(1, "the GPS has lost its fix"), (2, "the GPS has lost its fix"), (None, "nothing is heard of the GPS")]
)
def test_a_gps_that_is_lost_in_the_air_is_told_within_a_second_with_its_cause(flying, fix, said):
    assert (status(flying), why(flying)) == ("KNOWN", "")
    flying.guidance.take_notes()
    flying.vehicle.fix = fix
    assert LOST_S - 0.25 < flying.until(lambda _: status(flying) == "LOST", 2.0) < LOST_S + 0.25
    assert why(flying) == said
    assert flying.guidance.take_notes() == [f"the position is lost: {said}"]
    assert flying.report.authority, "the vehicle can be landed"


def test_the_first_cause_stays_and_a_position_that_is_back_counts_after_three_seconds(flying):
    flying.vehicle.fix = None
    flying.run(2.0)
    flying.vehicle.fix, flying.vehicle.estimator = 0, WITHOUT_POSITION
    flying.run(2.0)
    assert (status(flying), why(flying)) == ("LOST", "nothing is heard of the GPS")
    flying.vehicle.fix, flying.vehicle.estimator = 3, 831
    assert flying.until(lambda _: status(flying) == "KNOWN", 6.0) == pytest.approx(BACK_S, abs=0.5)
    assert why(flying) == ""


def test_an_estimator_without_a_position_is_told_at_once(flying):
    flying.vehicle.estimator = WITHOUT_POSITION
    assert flying.until(lambda _: status(flying) == "LOST", 2.0) < 0.3
    assert why(flying) == "the autopilot's estimator has no position"


def test_a_vehicle_that_never_had_a_fix_flies_by_what_its_estimator_has(flight):
    flight.vehicle.fix = 0
    flight.take_off()
    flight.run(3.0)
    assert status(flight) == "KNOWN"


def test_an_autopilot_that_says_nothing_of_it_is_not_judged(flight):
    flight.withheld = {"GPS_RAW_INT", "EKF_STATUS_REPORT"}
    flight.take_off()
    assert status(flight) is None
    assert flight.guidance.reasons(flight.now_s) == {}


@pytest.mark.parametrize("silent_s", [0.5, 2.0])
def test_streams_that_another_client_has_reset_are_no_lost_gps(flying, silent_s):
    seen = []
    everything = {"GPS_RAW_INT", "EKF_STATUS_REPORT", "ATTITUDE", "LOCAL_POSITION_NED", "SYS_STATUS"}
    flying.withheld = everything
    for _ in range(round(silent_s / 0.05)):
        flying.run(0.05)
        seen.append(status(flying))
    flying.withheld = set()
    for _ in range(40):
        flying.run(0.05)
        seen.append(status(flying))
    assert set(seen) == {"KNOWN"}


@given(st.lists(st.tuples(st.floats(0.01, 0.5), st.booleans()), min_size=1, max_size=60))
def test_a_position_is_lost_as_long_as_a_fix_has_been_missing_for_too_long(told):
    """Of steps that hear of a fix or not, the attitude being told at each: judged by the plain sum of the times since the last fix."""
    judge, now_s, without_s, well_s, fix_s = Positioning(), 0.0, 0.0, math.inf, 0.0
    judge.step(VehicleSnapshot(attitude_s=0.0, gps_s=0.0, fix_s=0.0, estimator_flags=831), 0.0, lost_s=LOST_S)
    for passed_s, fixed in told:
        now_s += passed_s
        fix_s = now_s if fixed else fix_s
        without_s = 0.0 if fixed else without_s + passed_s
        judge.step(VehicleSnapshot(attitude_s=now_s, gps_s=now_s, fix_s=fix_s, estimator_flags=831), now_s, lost_s=LOST_S)
        well_s = 0.0 if without_s >= LOST_S else well_s + passed_s
        assert judge.known == (well_s >= BACK_S)
        assert bool(judge.reason) != judge.known
