"""The telepilot's stick against the simulated autopilot: taking over, flying, stale input, giving back, and what is not fought."""

from __future__ import annotations

import math
import random

import pytest
from ground_station.control import ControlLink
from ground_station.stick import ASK_NS, CENTRED, FRESH_NS, GUIDED, LOITER, NS, Deflection, Stick
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_simulator.autopilot.types import Mode
from uav_simulator.flown import SimulatedAutopilotVehicle

TICK_S = 0.02
FORWARD = Deflection(forward=0.3)
PARAMS = {"FS_GCS_ENABLE": 1.0, "RC_OVERRIDE_TIME": 0.5}


class Scene:
    """A vehicle in the air, in GUIDED, its ground station, and what is between them."""

    def __init__(self) -> None:
        self.flown = SimulatedAutopilotVehicle(seed=0, params=PARAMS, ground_link=True)
        self.link = ControlLink()
        self.radio = True
        self.sent: list[mavlink.MAVLink_message] = []
        self.now_s = 0.0
        self._parser = mavlink.MAVLink(None)
        pilot = self.flown.autopilot
        self.run(1.0)
        pilot.set_mode(Mode.GUIDED)
        pilot.arm()
        pilot.take_off(10.0)
        self.run(15.0)
        assert (pilot.mode, self.sticks_sent) == (Mode.GUIDED, [])

    @property
    def mode(self) -> Mode:
        return self.flown.autopilot.mode

    @property
    def sticks_sent(self) -> list[mavlink.MAVLink_message]:
        return [message for message in self.sent if message.get_type() == "MANUAL_CONTROL"]

    @property
    def speed_m_s(self) -> float:
        return math.hypot(*self.flown.body.velocity)

    def run(self, seconds: float, stick: Deflection | None = None) -> None:
        """Let time pass with the telepilot's stick held at ``stick``; None: no stick is heard of."""
        for tick in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            now_ns = round(self.now_s * NS)
            if stick is not None and tick % 5 == 0:
                self.link.stick.move(stick, now_ns)
            for data in self.link.due(now_ns):
                self.sent += self._parser.parse_buffer(data) or []
                if self.radio:
                    self.flown.ground_endpoint.feed(data)
            self.flown.tick(self.now_s, TICK_S)
            self.flown.endpoint.take_output()
            out = self.flown.ground_endpoint.take_output()
            if self.radio:
                self.link.hear(out)


@pytest.fixture
def scene() -> Scene:
    made = Scene()
    made.run(0.5, CENTRED)
    return made


def test_a_stick_that_is_moved_takes_the_vehicle_over_and_flies_it(scene):
    begun = scene.flown.body.position
    scene.run(1.0, FORWARD)
    assert scene.mode is Mode.LOITER
    scene.run(3.0, FORWARD)
    assert scene.flown.body.position[0] - begun[0] > 3.0, "its nose points to the east"
    scene.run(6.0, CENTRED)
    assert scene.speed_m_s < 0.1
    assert scene.mode is Mode.LOITER, "centred is not given back"


def test_nothing_of_a_stick_is_sent_before_the_vehicle_says_that_the_telepilot_has_it(scene):
    scene.radio = False
    scene.run(2.0, FORWARD)
    assert not scene.sticks_sent
    assert [message.param2 for message in scene.sent if message.get_type() == "COMMAND_LONG"] == [LOITER] * 4
    assert scene.mode is Mode.GUIDED


@pytest.mark.parametrize("lost", ["joystick", "radio"])
def test_what_was_held_last_does_not_fly_on(scene, lost):
    scene.run(3.0, FORWARD)
    assert scene.speed_m_s > 2.0
    scene.radio = lost != "radio"
    scene.run(4.0, FORWARD if lost == "radio" else None)
    assert scene.speed_m_s < 0.2
    assert scene.mode is Mode.LOITER


def test_when_the_radio_stays_away_the_failsafe_flies_home_and_is_not_fought(scene):
    scene.run(2.0, FORWARD)
    scene.radio = False
    scene.run(6.0, FORWARD)
    assert scene.mode is Mode.RTL
    scene.radio = True
    scene.run(1.1, FORWARD)  # until the autopilot's next heartbeat
    scene.sent.clear()
    scene.run(5.0, FORWARD)
    assert (scene.mode, scene.sticks_sent) == (Mode.RTL, []), "the stick was not centred meanwhile"
    scene.run(1.0, CENTRED)
    assert scene.mode is Mode.RTL
    scene.run(1.0, FORWARD)
    assert scene.mode is Mode.LOITER, "a telepilot who moves the stick again takes over again"


def test_giving_back_is_guided_with_a_centred_stick_on_the_way(scene):
    stick, now_ns = scene.link.stick, round(scene.now_s * NS)
    assert stick.give_back(now_ns) == "the telepilot does not have the vehicle"
    scene.run(2.0, FORWARD)
    assert stick.give_back(round(scene.now_s * NS)) == ""
    scene.sent.clear()
    scene.run(1.0, FORWARD)
    assert scene.mode is Mode.GUIDED
    assert {message.x for message in scene.sticks_sent} <= {0}
    scene.sent.clear()
    scene.run(2.0, FORWARD)
    assert (scene.mode, scene.sticks_sent) == (Mode.GUIDED, [])


def test_a_stick_that_never_rested_takes_nothing_over():
    scene = Scene()
    scene.run(2.0, FORWARD)
    assert scene.mode is Mode.GUIDED


def test_a_mode_that_the_vehicle_does_not_take_is_not_asked_for_for_ever():
    stick = Stick()
    stick.move(CENTRED, 0)
    stick.move(FORWARD, 1)
    asked = [stick.mode_to_ask(n * NS // 10) for n in range(100)]
    assert [mode for mode in asked if mode is not None] == [LOITER] * (ASK_NS * 2 // NS)


def test_giving_back_does_not_end_a_failsafe():
    stick = Stick()
    stick.move(CENTRED, 0)
    stick.move(FORWARD, 1)
    stick.hear(LOITER)
    stick.give_back(NS)
    stick.hear(6)
    assert stick.mode_to_ask(NS) is None
    stick.hear(GUIDED)
    assert not stick.piloting


@pytest.mark.parametrize("wild", [math.nan, math.inf, 7.0, -1e300])
def test_axes_are_parts_of_one(wild):
    stick = Stick()
    stick.move(Deflection(wild, wild, wild, wild), NS)
    assert all(-1.0 <= axis <= 1.0 for axis in vars(stick.at(NS)).values())
    assert stick.at(NS + FRESH_NS + 1) == CENTRED


def test_garbage_from_the_radio_is_no_autopilot():
    link, chance = ControlLink(), random.Random(4)  # noqa: S311 - no secret
    link.stick.move(CENTRED, 0)
    link.stick.move(FORWARD, 1)
    stranger = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    forged = bytes(mavlink.MAVLink_heartbeat_message(2, 3, 0, LOITER, 4, 3).pack(stranger))
    for _ in range(200):
        link.hear(chance.randbytes(chance.randrange(300)) + forged)
    assert not link.stick.piloting
