"""The guidance and the fake vehicle in one loop, without sockets, threads or wall time: a flight of a minute takes a tenth of a second."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from guidance_fake_autopilot import FakeVehicle

from uav_guidance.encoding import command_message, heartbeat_message, interval_message, setpoint_message
from uav_guidance.follower import Setpoint
from uav_guidance.guidance import Guidance, GuidanceStatus
from uav_guidance.requests import GuidanceDecision, PositionRequest, Request, TakeoffRequest
from uav_guidance.settings import GuidanceSettings
from uav_guidance.streams import STREAMS_HZ, StreamKeeper
from uav_guidance.vectors import Vec3


class PureFlight:
    """Ticks of 20 ms; the guidance steps at every second or third of them, as the node does at 20 Hz on a clock of 50 Hz."""

    def __init__(self, settings: GuidanceSettings | None = None) -> None:
        self.vehicle = FakeVehicle(self._receive)
        self.guidance = Guidance(settings or GuidanceSettings())
        self.setpoints: list[tuple[float, Setpoint]] = []
        self.cut = False
        self.withheld: set[str] = set()
        self._next_step_s = self.now_s
        self._streams = StreamKeeper()
        self.vehicle.hear(heartbeat_message())
        self.ask_streams()

    @property
    def now_s(self) -> float:
        return self.vehicle.now_s

    @property
    def report(self) -> GuidanceStatus:
        return self.guidance.report(self.now_s)

    @property
    def commands(self) -> list[tuple[object, ...]]:
        return [entry for entry in self.vehicle.transcript if entry[0] != "setpoints"]

    def ask_streams(self) -> None:
        for number in self._streams.due(self.now_s):
            self.vehicle.hear(interval_message(number, STREAMS_HZ[number]))

    def tick(self) -> None:
        self.vehicle.tick()
        if self.now_s >= self._next_step_s - 1e-9:
            self._next_step_s += 0.05
            self.step()

    def step(self) -> None:
        if not self.cut:
            self.ask_streams()
        for item in self.guidance.step(self.now_s):
            if isinstance(item, Setpoint):
                self.setpoints.append((self.now_s, item))
            if not self.cut:
                self.vehicle.hear(setpoint_message(item) if isinstance(item, Setpoint) else command_message(item))

    def run(self, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.tick()

    def until(self, condition: Callable[[GuidanceStatus], bool], limit_s: float = 60.0) -> float:
        """Fly until the condition holds; return for how long."""
        begin_s = self.now_s
        while not condition(self.report):
            self.tick()
            if self.now_s - begin_s > limit_s:
                pytest.fail(f"not within {limit_s} s; last: {self.report}")
        return self.now_s - begin_s

    def ask(self, request: Request) -> GuidanceDecision:
        decision = self.guidance.ask(request, self.now_s)
        self.step()
        return decision

    def agreed(self, request: Request) -> GuidanceDecision:
        """Ask, and wait for the autopilot's agreement or refusal as the service does."""
        decision = self.ask(request)
        procedure = decision.procedure
        if procedure is None:
            return decision
        self.until(lambda _: procedure.outcome is not None, 20.0)
        assert procedure.outcome is not None
        return GuidanceDecision(procedure.outcome.accepted, procedure.outcome.reason, decision.reference_id)

    def take_off(self, height_m: float = 3.0) -> None:
        self.until(lambda r: r.authority and r.vehicle.ready)
        decision = self.agreed(TakeoffRequest(height_m, 1.5))
        assert decision.accepted, decision.reason
        self.until(lambda r: r.vehicle.landed == 2 and r.course.remaining_enu_m.norm < 0.1)

    def go(self, x: float, y: float, z: float = 3.0, *, speed: float = 1.5, along: bool = False) -> GuidanceDecision:
        return self.ask(PositionRequest(Vec3(x, y, z), speed, along))

    def _receive(self, message: object) -> None:
        if self.cut or message.get_type() in self.withheld:
            return
        self._streams.hear(message.get_msgId(), self.now_s)
        if message.get_type() == "STATUSTEXT":
            self.guidance.on_text(message.severity, message.text if isinstance(message.text, str) else message.text.decode(), self.now_s)
        self.guidance.on_message(message, self.now_s)
