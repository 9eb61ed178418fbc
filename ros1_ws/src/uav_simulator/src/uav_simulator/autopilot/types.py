"""The autopilot's vocabulary; the numbers are MAVLink's and ArduCopter's."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum


class Mode(IntEnum):
    """ArduCopter's flight modes (``custom_mode``), as far as this vehicle has them."""

    STABILIZE = 0
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    POSHOLD = 16
    BRAKE = 17


class Result(IntEnum):
    """MAV_RESULT: the autopilot's reply to a command."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class LandedState(IntEnum):
    """MAV_LANDED_STATE, without its value for unknown."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class SystemStatus(IntEnum):
    """MAV_STATE: the values that this autopilot takes."""

    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5


class Severity(IntEnum):
    """MAV_SEVERITY: the values that this autopilot uses."""

    EMERGENCY = 0
    CRITICAL = 2
    WARNING = 4
    NOTICE = 5
    INFO = 6


class Notice(Enum):
    """An event that a link sends without a request."""

    HEARTBEAT = "heartbeat"  # the mode or the arming state changed
    HOME = "home"
    ORIGIN = "origin"


@dataclass(frozen=True)
class Text:
    """A STATUSTEXT to be sent."""

    severity: Severity
    text: str
