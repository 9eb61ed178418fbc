"""The body over ArduPilot's JSON interface: bytes, lockstep, motors' senses, a flight, a restart."""

import json
import math
import socket
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from uav_simulator_ardupilot import InThread, Peer, packet, pwm_of

from uav_simulator.ardupilot.motors import HexaX, thrusts_n
from uav_simulator.ardupilot.protocol import BodyState, MotorPacket, answer, options, parse_packet
from uav_simulator.ardupilot.vehicle import ArduPilotVehicle
from uav_simulator.autopilot.types import LandedState
from uav_simulator.errors import ConfigError, SimulatorError
from uav_simulator.pilots import make_pilot
from uav_simulator.settings import SimulatorSettings
from uav_simulator.simulation import Simulation
from uav_simulator.vehicle.rigid_body import RigidBody
from uav_simulator.world.config import find_world, load_world

TICK_S = 0.02


@pytest.fixture
def vehicle():
    vehicle = ArduPilotVehicle(seed=0, port=0)
    yield vehicle
    vehicle.close()


def tick_while(flown, work, begin_s=0.0):
    """Tick the vehicle as long as the peer's work runs; return the time that it has come to."""
    job, now_s = InThread(work), begin_s
    while job.running:
        if flown.tick(now_s + TICK_S, TICK_S):
            now_s = round(now_s + TICK_S, 9)
    job.join()
    return now_s


# --- bytes -------------------------------------------------------------------------------------------------------------------


def test_a_packet_is_read_byte_for_byte():
    # magic 18458, 400 Hz, frame 7, outputs 1000 to 1015; little endian
    data = bytes.fromhex("1a48900107000000") + b"".join((1000 + n).to_bytes(2, "little") for n in range(16))
    assert len(data) == 40
    assert parse_packet(data) == MotorPacket(400, 7, tuple(range(1000, 1016)))
    wide = bytes.fromhex("8173900107000000") + bytes(64)
    assert parse_packet(wide) == MotorPacket(400, 7, (0,) * 32)
    for wrong in (b"", data[:-1], data + b"\0", b"\0\0" + data[2:], wide[:40]):
        assert parse_packet(wrong) is None


@given(st.binary(max_size=100))
def test_any_bytes_are_a_packet_or_none(data):
    found = parse_packet(data)
    assert found is None or len(data) in {40, 72}


def test_the_answer_is_one_line_of_json_between_newlines():
    line = answer(BodyState(0.0025, (0.1, 0.2, 0.3), (0.0, 0.0, -9.8), (1.0, 2.0, -3.0), (0.5, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
    assert line == (
        b'\n{"timestamp":0.0025,"imu":{"gyro":[0.1,0.2,0.3],"accel_body":[0.0,0.0,-9.8]},'
        b'"position":[1.0,2.0,-3.0],"velocity":[0.5,0.0,0.0],"quaternion":[1.0,0.0,0.0,0.0]}\n'
    )


@pytest.mark.parametrize(
    ("port", "instance", "told"),
    [
        (9002, None, "-I0"),
        (9012, None, "-I1"),
        (9012, 1, "-I1"),
        (9012, 0, "-I0 --sim-port-out 9012"),
        (9500, None, "-I49 --sim-port-out 9500"),
        (8000, None, "-I0 --sim-port-out 8000"),
    ],
)
def test_ardupilot_is_told_where_the_body_is(port, instance, told):
    assert options(port, instance) == f"--model JSON:127.0.0.1 {told}"


# --- motors ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("motor", "side", "spin"), [(1, "right", 1), (2, "left", -1), (3, "front", 1), (5, "front", -1), (6, "back", 1)])
def test_a_motor_sits_and_turns_as_in_hexa_x(motor, side, spin):
    x, y, sign = HexaX().rotor_places[motor - 1]
    place = {"right": -y, "left": y, "front": x, "back": -x}[side]
    assert place > 0.4
    assert sign == spin, "a clockwise rotor (1) turns the body counter-clockwise, positive in FLU"


@pytest.mark.parametrize(
    ("more", "axis"), [((2, 3, 6), (1, 0, 0)), ((4, 6), (0, 1, 0)), ((2, 4, 5), (0, 0, 1))], ids=["roll right", "pitch down", "yaw right"]
)
def test_more_thrust_turns_the_body_as_arducopter_means_it(more, axis):
    """In FRD: the left rotors roll it to the right, the rear ones pitch it down, the counter-clockwise ones turn it to the right."""
    body = RigidBody(HexaX(), (0.0, 0.0, 5.0))
    pwm = [pwm_of(0.6 if motor in more else 0.45) for motor in range(1, 7)]
    for _ in range(40):
        body.step(0.0025, thrusts_n(pwm, 45.0))
    p, q, r = body.rates[0], -body.rates[1], -body.rates[2]  # FRD
    turned = np.array([p, -q if axis[1] else q, r])
    assert turned @ np.array(axis) > 0.02
    assert abs(turned @ (1 - np.abs(axis))) < 0.3 * (turned @ np.array(axis)) + 0.02


def test_outputs_are_thrusts_as_the_parameters_say():
    assert thrusts_n([0] * 6, 45.0) == (0.0,) * 6, "no signal"
    assert thrusts_n([1100] * 16, 45.0) == (0.0,) * 6, "idling"
    assert thrusts_n([pwm_of(part) for part in (0.1, 0.3, 0.5, 0.7, 0.9, 1.0)], 100.0) == pytest.approx((10, 30, 50, 70, 90, 100), abs=0.3)
    assert thrusts_n([2500] * 6, 45.0) == (45.0,) * 6


# --- lockstep ----------------------------------------------------------------------------------------------------------------


def test_nothing_moves_without_packets_and_each_makes_one_step(vehicle):
    assert not vehicle.tick(TICK_S, TICK_S)
    peer = Peer(vehicle.port)
    times = []
    now_s = tick_while(vehicle, lambda: times.extend(peer.step([1000] * 6)["timestamp"] for _ in range(8)))
    assert now_s == TICK_S
    assert times == pytest.approx([0.0025 * n for n in range(1, 9)])
    assert not vehicle.tick(2 * TICK_S, TICK_S), "the next tick wants packets of its own"


@pytest.mark.parametrize(("rate_hz", "steps"), [(400, 8), (1200, 24), (50, 1), (0, 1), (65535, 40)])
def test_a_tick_has_as_many_steps_as_the_frame_rate_asks_for(vehicle, rate_hz, steps):
    peer = Peer(vehicle.port, rate_hz=rate_hz)
    assert tick_while(vehicle, lambda: [peer.step([1000] * 6) for _ in range(steps)]) == TICK_S
    assert peer.state["timestamp"] == pytest.approx(TICK_S)


def test_a_frame_that_comes_twice_gets_its_answer_again_and_moves_nothing(vehicle):
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.settimeout(5.0)
    sock.connect(("127.0.0.1", vehicle.port))
    answers = []

    def work():
        for frame in (0, 1, 1, 1, 2):
            sock.send(packet(frame, [1500] * 6))
            answers.append(sock.recv(4096))

    tick_while(vehicle, work)
    assert answers[1] == answers[2] == answers[3]
    assert [json.loads(line)["timestamp"] for line in answers] == pytest.approx([0.0025, 0.005, 0.005, 0.005, 0.0075])
    sock.close()


def test_packets_repeated_while_time_was_held_get_one_answer(vehicle):
    peer = Peer(vehicle.port)
    sock = peer.socket
    now_s = tick_while(vehicle, lambda: [peer.step([1000] * 6) for _ in range(8)])
    for _ in range(5):  # once a second, while time stands still
        sock.send(packet(8, [1000] * 6))
    frames = []

    def work():
        frames.append(json.loads(sock.recv(4096)))
        for frame in (9, 10):
            sock.send(packet(frame, [1000] * 6))
            frames.append(json.loads(sock.recv(4096)))

    tick_while(vehicle, work, now_s)
    assert [state["timestamp"] for state in frames] == pytest.approx([0.0225, 0.025, 0.0275]), "each packet has the answer to itself"


def test_an_autopilot_that_restarts_behind_repetitions_is_answered(vehicle):
    before, after = Peer(vehicle.port), Peer(vehicle.port)
    now_s = tick_while(vehicle, lambda: [before.step([1000] * 6) for _ in range(8)])
    for _ in range(3):
        before.socket.send(packet(8, [1000] * 6))
    tick_while(vehicle, lambda: after.step([1000] * 6), now_s)
    assert after.state["timestamp"] == pytest.approx(0.0025)


def test_garbage_is_left_alone_and_a_taken_port_is_named(vehicle):
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for wrong in (b"", b"\x1a", struct.pack("<HHI", 18458, 400, 0), bytes(65000)):
        sock.sendto(wrong, ("127.0.0.1", vehicle.port))
    assert not vehicle.tick(TICK_S, TICK_S)
    sock.sendto(packet(0, [1000] * 6), ("127.0.0.1", vehicle.port))
    sock.close()  # the answer finds no socket
    assert not vehicle.tick(TICK_S, TICK_S)
    peer = Peer(vehicle.port)
    tick_while(vehicle, lambda: peer.step([1000] * 6))
    assert peer.state["position"] == [0.0, 0.0, 0.0]
    with pytest.raises(SimulatorError, match=f"UDP port {vehicle.port} .* for ArduPilot"):
        ArduPilotVehicle(seed=0, port=vehicle.port)


@pytest.mark.parametrize("kind", ["ardupilot", "followed:udpin:127.0.0.1:0"])
def test_a_world_whose_home_is_not_its_origin_is_refused_for_an_autopilot_that_counts_from_where_it_stands(kind):
    settings = SimulatorSettings(vehicle=kind, ardupilot_port=0)
    make_pilot(settings, (0.0, 0.0, 0.0)).close()
    with pytest.raises(ConfigError, match=r"`home` is \(5, -2, 0\): .* measures from where it is switched on"):
        make_pilot(settings, (5.0, -2.0, 0.0))
    pilot = make_pilot(SimulatorSettings(mavlink_port=0), (5.0, -2.0, 0.0))
    assert pilot.flown.body.position == (5.0, -2.0, 0.0)
    pilot.close()


# --- a flight ----------------------------------------------------------------------------------------------------------------


def test_at_rest_the_sensors_feel_gravity_and_the_nose_points_east(vehicle):
    peer = Peer(vehicle.port)
    tick_while(vehicle, lambda: peer.fly(0.0, math.pi / 2, 0.1))
    assert peer.state["imu"]["accel_body"] == pytest.approx([0.0, 0.0, -9.80665])
    assert peer.state["imu"]["gyro"] == pytest.approx([0.0, 0.0, 0.0])
    assert peer.state["quaternion"] == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    assert vehicle.landed_state is LandedState.ON_GROUND


def test_a_flight_is_flown_by_motor_outputs_and_the_sensors_agree_with_the_motion():
    flown = ArduPilotVehicle(seed=2, port=0)
    simulation = Simulation(load_world(find_world("yard")), flown, seed=2)
    peer = Peer(flown.port)
    states = []

    def work():
        peer.fly(3.0, math.pi / 2, 5.0, until=lambda s: s["position"][2] < -2.8, states=states)
        peer.fly(3.0, math.pi / 2 + 0.5, 1.5, states=states)
        peer.fly(-1.0, math.pi / 2 + 0.5, 9.0, until=lambda s: s["position"][2] == 0.0, states=states)

    job = InThread(work)
    seen = set()
    while job.running:
        if simulation.tick():
            seen.add(simulation.flown.landed_state)
    job.join()
    flown.close()
    assert seen == {LandedState.ON_GROUND, LandedState.TAKING_OFF, LandedState.IN_AIR, LandedState.LANDING}
    assert simulation.lift_off_s < 2.0
    assert simulation.state.collisions == 0
    assert simulation.now_s == pytest.approx(peer.state["timestamp"], abs=TICK_S)
    # What the accelerometers feel, turned into the world and integrated, is the velocity: also through the touch-down.
    velocity, worst = np.zeros(3), 0.0
    for state in states:
        w, x, y, z = state["quaternion"]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        velocity += (turn @ state["imu"]["accel_body"] + [0.0, 0.0, 9.80665]) * 0.0025
        worst = max(worst, abs(velocity[2] - state["velocity"][2]))
    assert worst < 0.01
    assert max(np.abs(s["imu"]["accel_body"]).max() for s in states) < 16 * 9.81, "within the accelerometers' range"


def test_an_autopilot_that_restarts_finds_the_body_and_a_time_from_zero(vehicle):
    peer = Peer(vehicle.port)
    now_s = tick_while(vehicle, lambda: peer.fly(3.0, math.pi / 2, 2.0))
    assert vehicle.body.position[2] > 1.0
    restarted = Peer(vehicle.port)
    now_s = tick_while(vehicle, lambda: [restarted.step([1000] * 6) for _ in range(4)], now_s)
    assert restarted.state["timestamp"] == pytest.approx(0.01)
    assert -restarted.state["position"][2] == pytest.approx(vehicle.body.position[2])
    now_s = tick_while(vehicle, lambda: restarted.fly(-1.0, math.pi / 2, 8.0, until=lambda s: s["position"][2] == 0.0), now_s)
    assert now_s > 2.0, "the simulation's clock goes on"
