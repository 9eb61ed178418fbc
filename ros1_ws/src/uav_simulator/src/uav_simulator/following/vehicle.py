"""The body of a vehicle that is simulated or flown elsewhere: pose and time are its autopilot's."""

from __future__ import annotations

import logging
import time
from typing import Any

from uav_simulator.autopilot.types import LandedState
from uav_simulator.following.link import ListeningLink
from uav_simulator.following.track import LinkTrack
from uav_simulator.frames import Vec3
from uav_simulator.sensors.faults import SensorMode
from uav_simulator.vehicle.airframe import GRAVITY_M_S2, Airframe
from uav_simulator.vehicle.quaternion import rotate
from uav_simulator.vehicle.rigid_body import ZERO, RigidBody

WAIT_S = 0.1  # wall clock that one call of `tick` waits for messages
SILENCE_S = 10.0  # wall clock; then, and so often, it is told

log = logging.getLogger(__name__)


class FollowedVehicle:
    """Follows one autopilot; its position, with its errors, counts as the truth, for nothing better is known."""

    def __init__(self, url: str, home: Vec3 = ZERO) -> None:
        self.body = RigidBody(Airframe(), home)
        self.landed_state = LandedState.ON_GROUND
        self._url = url
        self._link = ListeningLink(url)
        self._track = LinkTrack(home)
        self._velocity: Vec3 | None = None
        self._tell_wall_s = time.monotonic() + SILENCE_S

    def tick(self, now_s: float, dt_s: float) -> bool:
        """Move the body to the autopilot's pose at this moment of its clock; False when that has not come so far."""
        until_s = time.monotonic() + WAIT_S
        while self.listen():
            pass  # all that has come: what waits in the socket is how late the simulation is
        while not self.known(now_s):
            rest_s = until_s - time.monotonic()
            if rest_s <= 0.0:
                self._tell_silence()
                return False
            self.listen(rest_s)
        self._move(now_s, dt_s)
        return True

    def listen(self, wait_s: float = 0.0) -> bool:
        """Handle the autopilot's messages so far, or the first within ``wait_s`` seconds; return whether there was one."""
        messages = self._link.read(wait_s)
        for message in messages:
            self._take(message)
        return bool(messages)

    def close(self) -> None:
        """Close the MAVLink connection to the autopilot that is followed."""
        self._link.close()

    def known(self, now_s: float) -> bool:
        """Return whether the autopilot has come so far."""
        newest_s = self._track.newest_s
        return newest_s is not None and newest_s >= now_s

    @property
    def estimator(self) -> None:
        """Return None: it is not the simulator's."""
        return None

    def expose(self, wind: SensorMode, pilot: SensorMode) -> None:
        """Do nothing: wind and pilot are those of the autopilot that flies."""

    def late_s(self, now_s: float) -> float:
        """Return how many seconds the autopilot's last message is ahead."""
        newest_s = self._track.newest_s
        return 0.0 if newest_s is None else max(newest_s - now_s, 0.0)

    def _take(self, message: Any) -> None:
        self._tell_wall_s = time.monotonic() + SILENCE_S
        self._track.take(message)
        if message.get_type() == "EXTENDED_SYS_STATE" and message.landed_state in LandedState._value2member_map_:
            self.landed_state = LandedState(message.landed_state)

    def _move(self, now_s: float, dt_s: float) -> None:
        motion, body = self._track.at(now_s), self.body
        before = self._velocity or motion.velocity
        self._velocity = motion.velocity
        ax, ay, az = ((after - then) / dt_s for after, then in zip(motion.velocity, before, strict=True))
        w, x, y, z = motion.attitude
        body.specific_force = rotate((w, -x, -y, -z), (ax, ay, az + GRAVITY_M_S2))
        x, y, z = motion.position
        body.position = (x, y, max(z, 0.0))  # an estimate may be centimetres below the ground, which carries the body
        body.velocity, body.attitude, body.rates = motion.velocity, motion.attitude, motion.rates
        body.on_ground = self.landed_state is LandedState.ON_GROUND

    def _tell_silence(self) -> None:
        if time.monotonic() >= self._tell_wall_s:
            self._tell_wall_s += SILENCE_S
            log.warning("no position and attitude from the autopilot at %s for %g s", self._url, SILENCE_S)
