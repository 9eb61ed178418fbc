"""Sensors that follow an autopilot over MAVLink: they are where it says, when it says, also after it has restarted."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_simulator.autopilot.link_server import LinkServer
from uav_simulator.autopilot.types import LandedState
from uav_simulator.errors import ConfigError
from uav_simulator.flown import SimulatedAutopilotVehicle
from uav_simulator.following.track import LinkTrack
from uav_simulator.following.vehicle import FollowedVehicle
from uav_simulator.frames import yaw_ned_from_enu
from uav_simulator.settings import settings_from_params
from uav_simulator.vehicle.quaternion import euler_zyx

TICK_S = 0.02


def place(boot_ms, north_m, east_m=0.0, down_m=-2.0):
    return mavlink.MAVLink_local_position_ned_message(boot_ms, north_m, east_m, down_m, 1.0, 0.0, 0.0)


def angles(boot_ms, roll=0.0, pitch=0.0, yaw=0.0):
    return mavlink.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0.1, 0.2, 0.3)


def test_time_begins_when_place_and_attitude_are_known_and_goes_as_far_as_both_are():
    track = LinkTrack()
    track.take(place(5000, 0.0))
    assert track.newest_s is None
    track.take(angles(5010))
    track.take(place(5100, 0.2))
    assert track.newest_s == 0.0
    track.take(angles(5060))
    assert track.newest_s == pytest.approx(0.05)


def test_time_goes_on_without_a_place_which_an_autopilot_has_40_s_after_power_up():
    track = LinkTrack((1.0, 2.0, 0.0))
    for boot_ms in range(5000, 6000, 20):
        track.take(angles(boot_ms))
        assert track.newest_s is None, "where it flies already, its place comes within a second"
    track.take(angles(6000))
    assert track.newest_s == 0.0, "what is past is not made up for"
    track.take(angles(6500, yaw=0.5))
    assert track.newest_s == pytest.approx(0.5)
    motion = track.at(0.5)
    assert (motion.position, motion.velocity) == ((1.0, 2.0, 0.0), (0.0, 0.0, 0.0))
    assert yaw_ned_from_enu(euler_zyx(motion.attitude)[2]) == pytest.approx(0.5)
    for boot_ms in (6600, 6700):
        track.take(angles(boot_ms))
        track.take(place(boot_ms, 7.0))
    assert track.newest_s == pytest.approx(0.7)
    assert track.at(0.7).position == pytest.approx((0.0, 7.0, 2.0))


def test_an_autopilot_that_restarts_leaves_the_body_where_it_was_until_it_has_a_place_again():
    track = LinkTrack()
    for boot_ms in (90_000, 90_100):
        track.take(angles(boot_ms))
        track.take(place(boot_ms, 7.0))
    track.at(0.1)
    for boot_ms in range(300, 2400, 100):
        track.take(angles(boot_ms))
    assert track.newest_s == pytest.approx(1.1)
    assert track.at(1.1).position == pytest.approx((0.0, 7.0, 2.0))
    assert track.at(1.1).velocity == (0.0, 0.0, 0.0)


def test_between_two_messages_the_motion_is_linear_in_map_and_body_axes():
    track = LinkTrack()
    for message in (place(1000, 0.0), angles(1000, yaw=0.0), place(1100, 0.2), angles(1100, roll=0.1, pitch=0.2, yaw=0.1)):
        track.take(message)
    half, end = track.at(0.05), track.at(0.1)
    assert half.position == pytest.approx((0.0, 0.1, 2.0))
    assert half.velocity == pytest.approx((0.0, 1.0, 0.0))
    assert half.rates == pytest.approx((0.1, -0.2, -0.3))
    assert euler_zyx(end.attitude) == pytest.approx((0.1, -0.2, math.pi / 2.0 - 0.1))


def test_an_autopilot_that_restarts_goes_on_at_the_time_that_was_reached():
    track = LinkTrack()
    for boot_ms in (90_000, 90_100):
        track.take(place(boot_ms, 0.0))
        track.take(angles(boot_ms))
    track.at(0.1)
    track.take(place(300, 7.0))
    assert track.newest_s is None
    track.take(angles(300))
    track.take(place(400, 7.0))
    track.take(angles(400))
    assert track.newest_s == pytest.approx(0.2)
    assert track.at(0.2).position == pytest.approx((0.0, 7.0, 2.0))


class Elsewhere:
    """An autopilot with a body of its own behind a TCP port."""

    def __init__(self) -> None:
        self.vehicle = SimulatedAutopilotVehicle(seed=0)
        self.server = LinkServer(self.vehicle.endpoint, None, port=0, gcs_port=0)
        self.now_s = 0.0

    def go(self, ticks=1):
        for _ in range(ticks):
            self.now_s += TICK_S
            self.vehicle.tick(self.now_s, TICK_S)
            self.server.serve()


def test_the_body_is_where_a_flying_autopilot_says_on_its_clock():
    peer = Elsewhere()
    followed = FollowedVehicle(f"tcp:127.0.0.1:{peer.server.port}")
    ticks, peers, states = 0, [], set()
    try:
        while followed.landed_state is not LandedState.IN_AIR and peer.now_s < 60.0:
            peer.go()
            peers.append((peer.vehicle.body.position, peer.vehicle.body.attitude))
            if peer.now_s == pytest.approx(1.0):
                for number, values in ((176, (1.0, 4.0)), (400, (1.0,)), (22, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0))):
                    peer.vehicle.endpoint.feed(command(number, *values))
            followed.listen()
            while followed.known((ticks + 1) * TICK_S):
                ticks += 1
                assert followed.tick(ticks * TICK_S, TICK_S)
                states.add(followed.landed_state)
        assert {LandedState.ON_GROUND, LandedState.TAKING_OFF, LandedState.IN_AIR} <= states | {followed.landed_state}
        assert followed.body.position[2] > 2.0
        nearest = min(peers, key=lambda at: math.dist(at[0], followed.body.position))
        assert math.dist(nearest[0], followed.body.position) < 0.1, "the autopilot's estimate is a few centimetres off"
        yaws = [yaw_ned_from_enu(euler_zyx(attitude)[2]) for attitude in (nearest[1], followed.body.attitude)]
        assert yaws[0] == pytest.approx(yaws[1], abs=0.03)
        assert peer.now_s - 1.0 < ticks * TICK_S <= peer.now_s, "no further than the autopilot's clock"
        assert not followed.tick((ticks + 1000) * TICK_S, TICK_S)
    finally:
        followed.close()
        peer.server.close()


def test_a_simulation_that_falls_behind_is_told_by_how_much():
    peer = Elsewhere()
    followed = FollowedVehicle(f"tcp:127.0.0.1:{peer.server.port}")
    try:
        assert followed.late_s(0.0) == 0.0
        while not followed.known(2.0) and peer.now_s < 60.0:
            peer.go()
            followed.listen()
        assert followed.late_s(0.5) >= 1.5
        assert followed.late_s(60.0) == 0.0
        assert SimulatedAutopilotVehicle(seed=0).late_s(0.0) == 0.0
    finally:
        followed.close()
        peer.server.close()


def command(number, *values):
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *values, *([0.0] * (7 - len(values)))).pack(sender)


def test_an_estimate_below_the_ground_leaves_the_body_on_it():
    followed = FollowedVehicle("tcp:127.0.0.1:1")
    for boot_ms in (1000, 1020):
        followed._track.take(place(boot_ms, 3.0, down_m=0.005))
        followed._track.take(angles(boot_ms))
    assert followed.tick(TICK_S, TICK_S)
    assert followed.body.position == pytest.approx((0.0, 3.0, 0.0))
    followed.close()


def test_without_an_answer_time_stands_still():
    followed = FollowedVehicle("tcp:127.0.0.1:1")
    assert not followed.tick(TICK_S, TICK_S)
    followed.close()


def test_the_vehicle_is_named_with_its_connection():
    assert settings_from_params({"vehicle": "followed:udpin:127.0.0.1:14551"}).followed_url == "udpin:127.0.0.1:14551"
    assert settings_from_params({}).followed_url == ""
    with pytest.raises(ConfigError, match="'followed:' is none of simulated, ardupilot, followed:URL"):
        settings_from_params({"vehicle": "followed:"})
