"""Braking before obstacles, and when no sensor watches the way."""

from __future__ import annotations

import math

import pytest
from guidance_pure_flight import PureFlight

from uav_guidance.obstacles import Sighting
from uav_guidance.requests import LandRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.vectors import Vec3


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


def test_brakes_within_0_3_s_when_no_sensor_watches_any_more_and_goes_on_when_one_does(flying):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 4.0)
    see(flying, None)
    assert braking_begins_s(flying) <= 0.3
    assert flying.report.course.unwatched
    flying.run(3.0)
    stopped_x = flying.vehicle.enu[0]
    flying.run(3.0)
    assert flying.vehicle.enu[0] == pytest.approx(stopped_x, abs=0.05), "it stays until a sensor watches"
    watch(flying, 2.0, source="lidar")
    assert not flying.report.course.obstacle_stop
    assert flying.vehicle.enu[0] > stopped_x + 1.0


def test_an_obstacle_that_no_sensor_sees_any_more_is_not_forgotten(flying):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 3.0)
    watch(flying, 1.0, flying.vehicle.enu[0] + 3.5)
    flying.run(10.0)
    assert flying.report.course.obstacle_stop
    assert flying.report.course.obstacle_m == math.inf


def test_an_obstacle_far_ahead_does_not_free_the_way_to_it_where_that_is_not_seen(flying):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 3.0)
    watch(flying, 2.5, flying.vehicle.enu[0] + 9.0, unknown=True)
    assert flying.report.course.obstacle_stop
    assert flying.report.course.unwatched
    assert math.isfinite(flying.report.course.obstacle_m), "it is known all the same"
    see(flying, None, "lidar")
    flying.run(0.1)
    assert not flying.report.course.obstacle_stop, "another sensor sees the way"


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


def test_a_climb_on_the_spot_needs_no_way_ahead(flying):
    watch(flying, 0.5, unknown=True)
    x, y, z = flying.vehicle.enu
    flying.go(x + 0.2, y, z + 4.0)
    watch(flying, 8.0, unknown=True)
    assert not flying.report.course.obstacle_stop
    assert flying.vehicle.enu[2] == pytest.approx(z + 4.0, abs=0.2)
    flying.go(x + 5.0, y, z + 4.0)
    watch(flying, 1.0, unknown=True)
    assert flying.report.course.obstacle_stop


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


def test_where_no_sensor_has_watched_in_this_flight_it_flies_unwatched(flying):
    flying.go(3.0, 0.0)
    flying.until(lambda r: r.course.remaining_enu_m.norm < 0.2)
    watch(flying, 1.0)
    flying.run(1.0)
    assert flying.report.course.unwatched
    flying.agreed(LandRequest())
    flying.until(lambda r: not r.vehicle.armed)
    flying.run(0.2)
    assert not flying.report.course.unwatched, "the next flight begins again"


def test_standing_vehicle_is_not_stopped(flying):
    see(flying, flying.vehicle.enu[0] + 1.0)
    flying.run(0.2)
    assert not flying.report.course.obstacle_stop
    assert flying.report.course.obstacle_m == pytest.approx(1.0, abs=0.1)


def test_other_settings_hold_from_the_next_request_and_verdict_on(flying):
    flying.go(20.0, 0.0, speed=1.5)
    flying.guidance.tune(GuidanceSettings(max_speed_m_s=1.0, obstacle_stop_m=6.0))
    assert flying.go(0.0, 0.0, speed=1.5).reason == "speed is 1.5: at most 1 is allowed"
    assert flying.report.course.reference == "position", "what is under way goes on"
    flying.run(2.0)
    see(flying, flying.vehicle.enu[0] + 5.5)
    flying.run(0.1)
    assert flying.report.course.obstacle_stop
