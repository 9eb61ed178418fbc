"""What the guidance refuses, in which words, and that a refusal changes nothing."""

from __future__ import annotations

import math

import pytest

from uav_guidance.guidance import Guidance
from uav_guidance.requests import HeadingRequest, HoverRequest, PositionRequest, TakeoffRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Vec3

NAN = math.nan


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        (PositionRequest(Vec3(61.0, 0.0, 3.0), 1.0, along_travel=False), "outside the fence: 61.0 m from home, at most 60 m are allowed"),
        (PositionRequest(Vec3(1.0, 0.0, 20.5), 1.0, along_travel=False), "outside the fence: 20.50 m above home, 0.5 to 20 m are allowed"),
        (PositionRequest(Vec3(1.0, 0.0, 0.4), 1.0, along_travel=False), "outside the fence: 0.40 m above home, 0.5 to 20 m are allowed"),
        (PositionRequest(Vec3(NAN, 0.0, 3.0), 1.0, along_travel=False), "target (nan, 0.0, 3.0): not a number"),
        (PositionRequest(Vec3(1.0, 0.0, 3.0), NAN, along_travel=False), "speed is nan: not a number"),
        (PositionRequest(Vec3(1.0, 0.0, 3.0), 0.0, along_travel=False), "speed is 0: it must be positive"),
        (PositionRequest(Vec3(1.0, 0.0, 3.0), 3.1, along_travel=False), "speed is 3.1: at most 3 is allowed"),
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
    guidance = Guidance(GuidanceSettings())
    assert guidance.fence_reason(Vec3(1.0, 0.0, 3.0)) == "home is not known yet, so the fence is not"
    assert guidance.ask(HoverRequest(), 0.0).reason == "no authority: nothing was heard of the autopilot"


def test_take_off_of_a_vehicle_that_is_not_ready_says_why(flight):
    flight.until(lambda r: r.authority)
    flight.vehicle._ready_from_s = math.inf
    flight.until(lambda r: not r.vehicle.ready)
    flight.guidance.on_text(2, "PreArm: Compass not healthy", flight.now_s)
    assert flight.ask(TakeoffRequest(3.0, 1.0)).reason == "the autopilot is not ready: Compass not healthy"
