"""Garbage on every input of the guidance: no crash, no silence for ever, no wrong command."""

from __future__ import annotations

import math
import random
import struct

import pytest
from guidance_pure_flight import PureFlight
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from test_uav_guidance_watching import see, watch

from uav_guidance.follower import Setpoint
from uav_guidance.obstacles import Sighting
from uav_guidance.requests import HoverRequest
from uav_guidance.vectors import Vec3

KINDS = [
    mavlink.MAVLink_heartbeat_message,
    mavlink.MAVLink_sys_status_message,
    mavlink.MAVLink_extended_sys_state_message,
    mavlink.MAVLink_local_position_ned_message,
    mavlink.MAVLink_attitude_message,
    mavlink.MAVLink_home_position_message,
    mavlink.MAVLink_gps_global_origin_message,
    mavlink.MAVLink_command_ack_message,
    mavlink.MAVLink_statustext_message,
]


def noise(kind: type, rng: random.Random) -> bytes:
    """A frame of MAVLink 2 whose payload is random, or all not a number, and whose checksum is right.

    Ten bytes of header from 0xFD on, the payload, and a checksum over all but the first byte and the message's own extra one.
    """
    size = kind.unpacker.size
    payload = rng.choice([rng.randbytes(size), (struct.pack("<f", math.nan) * (size // 4 + 1))[:size]])
    header = struct.pack("<BBBBBBBHB", 0xFD, size, 0, 0, 0, 1, 1, kind.id, 0)
    crc = mavlink.x25crc(header[1:] + payload)
    crc.accumulate(struct.pack("B", kind.crc_extra))
    return header + payload + struct.pack("<H", crc.crc)


def finite(setpoint: Setpoint) -> bool:
    place = setpoint.position_enu_m
    return all(math.isfinite(value) for value in (place.x, place.y, place.z, setpoint.yaw_rad))


def local_position(boot_ms: int, x: float) -> object:
    return mavlink.MAVLink_local_position_ned_message(boot_ms, x, 0.0, -3.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_place_that_is_no_number_is_left_out(flying: PureFlight, wrong: float):
    before = flying.report.vehicle
    flying.guidance.on_message(local_position(before.boot_ms + 5, wrong), flying.now_s)
    attitude = mavlink.MAVLink_attitude_message(before.boot_ms + 5, 0.0, 0.0, wrong, 0.0, 0.0, 0.0)
    flying.guidance.on_message(attitude, flying.now_s)
    assert flying.report.vehicle == before
    flying.setpoints.clear()
    assert flying.ask(HoverRequest()).accepted
    assert flying.setpoints
    assert all(finite(setpoint) for _, setpoint in flying.setpoints)


@pytest.mark.parametrize("seed", range(8))
def test_random_messages_do_not_crash_it_and_never_become_a_setpoint(flying: PureFlight, seed: int):
    rng, parser = random.Random(seed), mavlink.MAVLink(None)  # noqa: S311 -- repeatable on purpose
    parser.robust_parsing = True
    flying.go(20.0, 0.0)
    for _ in range(300):
        for message in parser.parse_buffer(noise(rng.choice(KINDS), rng)) or ():
            assert message.get_type() != "BAD_DATA"
            flying.guidance.on_message(message, flying.now_s)
        flying.tick()
    assert all(finite(setpoint) for _, setpoint in flying.setpoints)
    flying.run(3.0)
    assert flying.report.vehicle.located, "what it hears after that counts again"
    assert flying.report.vehicle.position_enu_m.z == pytest.approx(flying.vehicle.enu[2], abs=0.1)


@pytest.mark.parametrize("distance_m", [math.nan, math.inf, -math.inf])
def test_an_obstacle_without_a_distance_is_not_free(flying: PureFlight, distance_m: float):
    flying.go(30.0, 0.0, speed=1.5)
    watch(flying, 3.0)
    for _ in range(5):
        flying.guidance.on_obstacle(Sighting("zed", flying.now_s, True, distance_m, Vec3(math.nan, math.nan, math.nan)), flying.now_s)
        flying.run(0.1)
    assert flying.report.course.obstacle_stop
    see(flying, None)
    flying.run(0.1)
    assert not flying.report.course.obstacle_stop
