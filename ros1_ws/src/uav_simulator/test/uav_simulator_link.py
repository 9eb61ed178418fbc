"""A MAVLink client without a socket: it drives the autopilot's endpoint and the vehicle, 20 ms at a time."""

from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uav_simulator.autopilot.core import Autopilot
from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.vehicle.airframe import Airframe
from uav_simulator.vehicle.hexacopter import Hexacopter

TICK_S = 0.02
STABILIZE, GUIDED, LOITER, RTL, LAND, BRAKE = 0, 4, 5, 6, 9, 17
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
POSITION, POSITION_YAW, VELOCITY = 0x0DF8, 0x09F8, 0x0DC7


class Link:
    """One client of one autopilot on a vehicle in still air."""

    def __init__(self, *, boot_before_s: float = 60.0, system: int = 1, component: int = 191, params=None):
        airframe = Airframe()
        self.vehicle = Hexacopter(airframe, wind=None)
        self.pilot = Autopilot(self.vehicle, airframe, seed=0, boot_before_s=boot_before_s, params=params)
        self.endpoint = Endpoint(self.pilot)
        self.me = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._parser = mavlink.MAVLink(None)
        self.received = []  # (simulated seconds, message) since the last clear
        self.ticks = 0

    @property
    def now_s(self):
        return self.ticks * TICK_S

    def collect(self):
        for message in self._parser.parse_buffer(self.endpoint.take_output()) or []:
            self.received.append((self.now_s, message))

    def tick(self):
        self.ticks += 1
        self.vehicle.advance(TICK_S)
        self.pilot.step(self.now_s, TICK_S)
        self.endpoint.step()
        self.collect()

    def run(self, seconds, each_tick: Callable[[], None] | None = None):
        for _ in range(round(seconds / TICK_S)):
            if each_tick:
                each_tick()
            self.tick()

    def run_until(self, condition, *, timeout_s, each_tick=None):
        start = self.now_s
        while not condition():
            assert self.now_s - start < timeout_s, "not in time"
            if each_tick:
                each_tick()
            self.tick()
        return self.now_s - start

    def send(self, message):
        self.endpoint.feed(message.pack(self.me))
        self.collect()

    def command(self, command, *params):
        """Send a COMMAND_LONG and return the result of its acknowledgement."""
        self.received.clear()
        values = [*params, *([0.0] * (7 - len(params)))]
        self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *values))
        acks = [m for m in self.of("COMMAND_ACK") if m.command == command]
        assert len(acks) == 1, "one acknowledgement a command"
        assert (acks[0].target_system, acks[0].target_component) == (self.me.srcSystem, self.me.srcComponent)
        return acks[0].result

    def ask(self, *message_ids, hz=10):
        for message_id in message_ids:
            assert self.command(511, message_id, 1e6 / hz) == ACCEPTED

    def of(self, name, *, system=1):
        return [m for _, m in self.received if m.get_type() == name and m.get_srcSystem() == system]

    def texts(self):
        return [m.text for m in self.of("STATUSTEXT")]

    def setpoint(self, mask, position_ned=(0.0, 0.0, 0.0), velocity_ned=(0.0, 0.0, 0.0), yaw=0.0, yaw_rate=0.0, frame=1, accel=(0.0,) * 3):
        self.send(
            mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *position_ned, *velocity_ned, *accel, yaw, yaw_rate)
        )

    def guided_and_armed(self):
        assert self.command(176, 1, GUIDED) == ACCEPTED
        assert self.command(400, 1) == ACCEPTED
        return self

    def flying(self, height=3.0):
        """Take off and hover; return self."""
        self.guided_and_armed()
        assert self.command(22, 0, 0, 0, 0, 0, 0, height) == ACCEPTED
        self.run_until(lambda: self.landed_state == IN_AIR, timeout_s=20.0)
        self.run(1.0)
        return self

    @property
    def landed_state(self):
        return int(self.pilot.landed_state)

    @property
    def position(self):
        return self.vehicle.body.position

    def distance_to(self, position_enu):
        return math.dist(self.position, position_enu)


def yaw_ned_deg(link):
    return math.degrees(math.pi / 2.0 - link.pilot.estimate.yaw_rad) % 360.0
