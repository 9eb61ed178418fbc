"""An autopilot's motion between its messages, on its own clock."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import Any

from uav_simulator.frames import Quat, Vec3, enu_from_ned, frd_from_flu, yaw_enu_from_ned
from uav_simulator.vehicle.quaternion import from_yaw, multiply
from uav_simulator.vehicle.rigid_body import ZERO

PLACE_MS = 1000  # an autopilot that knows its place tells it within so long; one that has been switched on has none for 40 s
REBOOT_MS = 1000  # messages may come out of order by less
KEPT = 500  # of each kind: ten seconds at 50 Hz


@dataclass(frozen=True)
class FollowedMotion:
    """Map (ENU) and body (FLU); rates in the body's axes."""

    position: Vec3
    velocity: Vec3
    attitude: Quat
    rates: Vec3


class LinkTrack:
    """The track of an autopilot. Time is in seconds from the first moment with position and attitude; a restarted autopilot continues it.

    One that has no position yet counts as standing where it was last known to be, first at ``home`` (map, metres).
    """

    def __init__(self, home: Vec3 = ZERO) -> None:
        self._places: list[tuple[int, Vec3, Vec3]] = []
        self._attitudes: list[tuple[int, Quat, Vec3]] = []
        self._stands_at = home
        self._zero_ms: float | None = None
        self._asked_s = 0.0

    def take(self, message: Any) -> None:
        """Handle a message of the autopilot; all but LOCAL_POSITION_NED and ATTITUDE are ignored."""
        kind = message.get_type()
        if kind == "LOCAL_POSITION_NED":
            place, velocity = (message.x, message.y, message.z), (message.vx, message.vy, message.vz)
            self._append(self._places, (message.time_boot_ms, enu_from_ned(place), enu_from_ned(velocity)))
        elif kind == "ATTITUDE":
            rates = frd_from_flu((message.rollspeed, message.pitchspeed, message.yawspeed))
            self._append(self._attitudes, (message.time_boot_ms, _attitude(message.roll, message.pitch, message.yaw), rates))
        if self._zero_ms is None and self._attitudes:
            self._begin()

    @property
    def newest_s(self) -> float | None:
        """The last known moment; None before the first."""
        if self._zero_ms is None:
            return None
        newest_ms = min(told[-1][0] for told in (self._places, self._attitudes) if told)
        return (newest_ms - self._zero_ms) * 1e-3

    def at(self, now_s: float) -> FollowedMotion:
        """Return the motion at a moment up to `newest_s`, linear between two messages."""
        self._asked_s = now_s
        boot_ms = (self._zero_ms or 0.0) + 1e3 * now_s
        position, velocity = self._stands_at, ZERO
        if self._places:
            before, after, share = _around(self._places, boot_ms)
            position, velocity = _between(before[1], after[1], share), _between(before[2], after[2], share)
        early, late, part = _around(self._attitudes, boot_ms)
        return FollowedMotion(position, velocity, _turned(early[1], late[1], part), _between(early[2], late[2], part))

    def _begin(self) -> None:
        first_ms, newest_ms = self._attitudes[0][0], self._attitudes[-1][0]
        if self._places:
            self._zero_ms = max(self._places[0][0], first_ms) - 1e3 * self._asked_s
        elif newest_ms - first_ms >= PLACE_MS:
            self._zero_ms = newest_ms - 1e3 * self._asked_s

    def _append(self, told: list[Any], item: tuple[int, Any, Any]) -> None:
        last_ms = told[-1][0] if told else -1
        if item[0] + REBOOT_MS < last_ms:
            self._stands_at = self._places[-1][1] if self._places else self._stands_at
            self._places.clear()
            self._attitudes.clear()
            self._zero_ms = None
        elif item[0] <= last_ms:
            return
        told.append(item)
        del told[:-KEPT]


def _around(told: list[Any], boot_ms: float) -> tuple[Any, Any, float]:
    """Return the entries before and after a moment, and how far it is on the way from one to the other; clamped at the ends."""
    index = bisect_left(told, boot_ms, key=lambda item: item[0])
    after = told[min(index, len(told) - 1)]
    before = told[max(index - 1, 0)]
    span_ms = after[0] - before[0]
    return before, after, min(max((boot_ms - before[0]) / span_ms, 0.0), 1.0) if span_ms else 0.0


def _between(a: Vec3, b: Vec3, share: float) -> Vec3:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


def _turned(a: Quat, b: Quat, share: float) -> Quat:
    """Return the attitude between two that are a few degrees apart (normalised blend, w x y z)."""
    sign = 1.0 if sum(x * y for x, y in zip(a, b, strict=True)) >= 0.0 else -1.0
    w, x, y, z = ((1.0 - share) * p + share * sign * q for p, q in zip(a, b, strict=True))
    n = math.sqrt(w * w + x * x + y * y + z * z)
    return w / n, x / n, y / n, z / n


def _attitude(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Quat:
    """Return the attitude body FLU to ENU of MAVLink's angles (body FRD to NED)."""
    roll: Quat = (math.cos(roll_rad / 2.0), math.sin(roll_rad / 2.0), 0.0, 0.0)
    pitch: Quat = (math.cos(pitch_rad / 2.0), 0.0, -math.sin(pitch_rad / 2.0), 0.0)
    return multiply(multiply(from_yaw(yaw_enu_from_ned(yaw_rad)), pitch), roll)
