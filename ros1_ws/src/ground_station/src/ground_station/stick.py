"""The telepilot's stick: when it takes over the vehicle, which deflections it sends, and how it gives the vehicle back. Pure.

An ArduCopter lets sticks fly it in modes of the pilot's, in GUIDED it does not: so moving the stick takes LOITER first. Only while the
vehicle says that it is in LOITER is the stick sent, as MANUAL_CONTROL: four axes without any vehicle's calibration, which can't reach its
mode switch, as RC_CHANNELS_OVERRIDE can. In GUIDED nothing is sent, not even a centred stick: it would do nothing, it would lie on top of
a safety pilot's transmitter, and a second without radio would be the loss of a remote control, which ends the flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

NS = 1_000_000_000
GUIDED, LOITER = 4, 5
"""``custom_mode`` of an ArduCopter."""
DEAD_ZONE = 0.1
FRESH_NS = NS // 2  # a stick that says nothing for longer has gone: it is centred
PERIOD_NS = NS // 10
ASK_PERIOD_NS = NS // 2
ASK_NS = 3 * NS  # for so long a mode is asked for that the vehicle does not take


@dataclass(frozen=True)
class Deflection:
    """A stick's deflection, -1 to 1 on each axis: to the front, to the left, up, counter-clockwise."""

    forward: float = 0.0
    left: float = 0.0
    up: float = 0.0
    turn: float = 0.0

    def clipped(self) -> Deflection:
        """Return the deflection within the range of a stick; a component that is no number is centred."""
        axes = (axis if math.isfinite(axis) else 0.0 for axis in (self.forward, self.left, self.up, self.turn))
        return Deflection(*(min(max(axis, -1.0), 1.0) for axis in axes))

    @property
    def moved(self) -> bool:
        """Return whether the stick is held away from its middle."""
        return max(map(abs, (self.forward, self.left, self.up, self.turn))) > DEAD_ZONE


CENTRED = Deflection()


class Stick:
    """Times are nanoseconds of mission clock."""

    def __init__(self) -> None:
        self.piloting = False
        self._rested = False
        self._deflection = CENTRED
        self._moved_ns = 0
        self._wanted: int | None = None
        self._asked_until_ns = 0
        self._ask_due_ns = 0
        self._send_due_ns = 0

    def move(self, raw: Deflection, now_ns: int) -> None:
        """Store the stick's deflection; moved out of the middle, where it must have been, it takes the vehicle over."""
        deflection = raw.clipped()
        if deflection.moved and self._rested and not self.piloting:
            self._want(LOITER, now_ns)
        self._rested = not deflection.moved
        self._deflection, self._moved_ns = deflection, now_ns

    def give_back(self, now_ns: int) -> str:
        """Hand the vehicle back to the mission's guidance; return why that is not possible, empty where it is done."""
        if not self.piloting:
            return "the telepilot does not have the vehicle"
        self._want(GUIDED, now_ns)
        return ""

    def hear(self, mode: int) -> None:
        """Store the vehicle's mode. A change that was not requested here, as by a failsafe, ends the take-over and is not fought."""
        if mode == self._wanted:
            self.piloting, self._wanted = mode == LOITER, None
        elif self.piloting and mode != LOITER:
            self.piloting, self._wanted = False, None

    def at(self, now_ns: int) -> Deflection:
        """Return the stick's deflection; centred while none is received."""
        return self._deflection if now_ns - self._moved_ns <= FRESH_NS else CENTRED

    def mode_to_ask(self, now_ns: int) -> int | None:
        """Return the mode to request from the vehicle now; None: none."""
        if self._wanted is None or now_ns < self._ask_due_ns:
            return None
        if now_ns > self._asked_until_ns:
            self._wanted = None
            return None
        self._ask_due_ns = now_ns + ASK_PERIOD_NS
        return self._wanted

    def to_send(self, now_ns: int) -> Deflection | None:
        """Return the deflection to send to the vehicle now; None: none."""
        if not self.piloting or now_ns < self._send_due_ns:
            return None
        self._send_due_ns = now_ns + PERIOD_NS
        return self.at(now_ns) if self._wanted is None else CENTRED

    def _want(self, mode: int, now_ns: int) -> None:
        self._wanted, self._asked_until_ns, self._ask_due_ns = mode, now_ns + ASK_NS, now_ns
