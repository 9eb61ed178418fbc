"""The whole simulation without ROS: the route is flown as a client would, in wind, and repeats with its seed."""

import math
from itertools import pairwise

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from alula.common.faults import parse_faults
from uav_simulator.autopilot.types import LandedState
from uav_simulator.flown import SimulatedAutopilotVehicle
from uav_simulator.simulation import Simulation
from uav_simulator.world.config import find_world, load_world

CONFIG = load_world(find_world("yard"))
SPEED_M_S = 1.0


class Client:
    """Streams setpoints at 10 Hz along the route at the mission's speed, with the yaw of the leg."""

    def __init__(self, simulation):
        self.simulation = simulation
        self._mavlink = mavlink.MAVLink(None, srcSystem=1, srcComponent=191)

    def command(self, command, *params):
        values = [*params, *([0.0] * (7 - len(params)))]
        self.simulation.flown.endpoint.feed(mavlink.MAVLink_command_long_message(1, 1, command, 0, *values).pack(self._mavlink))

    def run_until(self, condition, timeout_s=20.0):
        start = self.simulation.now_s
        while not condition():
            assert self.simulation.now_s - start < timeout_s
            self.simulation.tick()

    def take_off(self):
        self.command(176, 1, 4)
        self.command(400, 1)
        self.command(22, 0, 0, 0, 0, 0, 0, 3.0)
        self.run_until(lambda: self.simulation.flown.autopilot.landed_state is LandedState.IN_AIR)

    def fly_leg(self, a, b):
        yaw_ned = math.atan2(b[0] - a[0], b[1] - a[1])
        for way in np.arange(0.0, math.dist(a, b) + 1e-6, 0.1 * SPEED_M_S):
            x, y, z = np.array(a) + (np.array(b) - np.array(a)) * way / math.dist(a, b)
            message = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x09F8, y, x, -z, 0, 0, 0, 0, 0, 0, yaw_ned, 0)
            self.simulation.flown.endpoint.feed(message.pack(self._mavlink))
            for _ in range(5):
                self.simulation.tick()
        self.run_until(lambda: math.dist(self.simulation.flown.body.position, b) < 0.3)


def fly_route(seed):
    simulation = Simulation(CONFIG, SimulatedAutopilotVehicle(seed=seed), seed=seed, faults=parse_faults("zed@30-35"))
    client = Client(simulation)
    client.take_off()
    for a, b in pairwise(CONFIG.route):
        client.fly_leg(a, b)
    client.command(21)
    client.run_until(lambda: not simulation.flown.autopilot.armed)
    return simulation


def test_the_route_is_flown_without_a_contact_and_with_clearance():
    state = fly_route(seed=1).state
    assert state.collisions == 0
    assert 0.8 <= state.min_clearance_m <= 2.0
    assert state.distance_m == pytest.approx(76.0 + 6.0, abs=4.0)
    assert 75.0 <= state.t_s - state.lift_off_s <= 130.0
    begin, end = (pytest.approx(state.lift_off_s + seconds, abs=0.03) for seconds in (30.0, 35.0))
    assert state.faults == [{"sensor": "zed", "mode": "dead", "t_s": begin}, {"sensor": "zed", "mode": "ok", "t_s": end}]


def test_flying_into_a_wall_is_a_contact_and_does_not_go_through():
    simulation = Simulation(CONFIG, SimulatedAutopilotVehicle(seed=0), seed=0, faults=[])
    client = Client(simulation)
    client.take_off()
    client.fly_leg((0.0, 0.0, 3.0), (4.0, 0.0, 3.0))
    message = mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x0DF8, -8, 4, -3, 0, 0, 0, 0, 0, 0, 0, 0)
    simulation.flown.endpoint.feed(message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=191)))
    for _ in range(400):
        simulation.tick()
    assert simulation.state.collisions >= 1
    assert simulation.state.min_clearance_m < 0.0
    assert simulation.flown.body.position[1] > -4.3


def test_the_same_seed_and_commands_give_the_same_flight_and_measurements():
    def run():
        simulation = Simulation(CONFIG, SimulatedAutopilotVehicle(seed=3), seed=3, faults=[])
        client = Client(simulation)
        client.take_off()
        client.fly_leg((0.0, 0.0, 3.0), (2.0, 0.0, 3.0))
        return simulation, simulation.stereo.render(simulation.pose), simulation.lidar.scan(simulation.track, simulation.now_s - 0.1)

    (a, images_a, cloud_a), (b, images_b, cloud_b) = run(), run()
    assert a.pose == b.pose
    assert all(np.array_equal(x, y) for x, y in zip(images_a, images_b, strict=True))
    assert np.array_equal(cloud_a, cloud_b)


def test_a_motor_that_stops_brings_the_vehicle_down_and_the_autopilot_leaves_the_others_on():
    flown = SimulatedAutopilotVehicle(seed=0)
    simulation = Simulation(CONFIG, flown, seed=0, faults=parse_faults("motor@4"))
    client = Client(simulation)
    client.take_off()
    client.run_until(lambda: flown.body.stopped_rotor is not None)
    client.command(21)
    client.run_until(lambda: flown.body.on_ground, 30.0)
    assert simulation.state.crash
    texts = [
        message.text for message in mavlink.MAVLink(None).parse_buffer(flown.endpoint.take_output()) if message.get_type() == "STATUSTEXT"
    ]
    assert [text for text in texts if "Thrust" in text] == ["Potential Thrust Loss (1)"]
    for _ in range(50 * 20):
        simulation.tick()
    assert (flown.autopilot.armed, flown.landed_state) == (True, LandedState.LANDING)
    client.command(400, 0)
    simulation.tick()
    assert flown.autopilot.armed, "as in the air"
    client.command(400, 0, 21196)
    simulation.tick()
    simulation.tick()
    assert (flown.autopilot.armed, flown.landed_state) == (False, LandedState.ON_GROUND)


def flown_with(fault):
    """Take off with a fault, and hold for 15 s; return the simulation and what the body did from 3 s after lift-off on."""
    flown = SimulatedAutopilotVehicle(seed=0)
    simulation = Simulation(CONFIG, flown, seed=0, faults=parse_faults(fault))
    Client(simulation).take_off()
    return simulation, flown


def lean_rad(flown):
    _, x, y, _ = flown.body.attitude
    return 2.0 * math.hypot(x, y)


def test_a_wind_that_rises_is_leant_against_and_calms_down():
    simulation, flown = flown_with("wind@4-14")

    def mean_lean_rad(begin_s, end_s):
        leans = []
        while simulation.now_s < simulation.lift_off_s + end_s:
            simulation.tick()
            leans += [lean_rad(flown)] if simulation.now_s >= simulation.lift_off_s + begin_s else []
        return sum(leans) / len(leans)

    strong, calm = mean_lean_rad(8.0, 14.0), mean_lean_rad(20.0, 24.0)
    assert 3.0 * calm < strong < math.radians(25.0)
    assert [(one["mode"], round(one["t_s"] - simulation.lift_off_s, 1)) for one in simulation.state.faults] == [
        ("strong", 4.0),
        ("ok", 14.0),
    ]


@pytest.mark.parametrize(("way", "mode"), [("takes", "LOITER"), ("lands", "LAND")])
def test_a_pilot_takes_the_vehicle_and_gives_it_back(way, mode):
    simulation, flown = flown_with(f"pilot:{way}@4-6")
    modes = []
    while simulation.now_s < simulation.lift_off_s + 8.0:
        simulation.tick()
        modes += [flown.autopilot.mode.name] if modes[-1:] != [flown.autopilot.mode.name] else []
    assert modes == ["GUIDED", mode, "GUIDED"]


def test_a_pilots_stick_turns_the_nose_while_it_is_moved():
    simulation, flown = flown_with("pilot:stick@4-6")

    def yaw_rad_at(since_s):
        while simulation.now_s < simulation.lift_off_s + since_s:
            simulation.tick()
        w, x, y, z = flown.body.attitude
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

    before, moved, later = (yaw_rad_at(since_s) for since_s in (4.0, 6.0, 10.0))
    assert moved - before == pytest.approx(1.0, abs=0.25)
    assert later == pytest.approx(before, abs=0.05), "in GUIDED it looks again where it was told to"
    assert flown.autopilot.mode.name == "GUIDED"
