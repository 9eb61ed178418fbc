"""What people and things outside the vehicle do to it: the pilot's switch and stick, the radio, the ground station.

Words of ``/sim/pilot`` (std_msgs/String): a mode's name (the pilot flips the switch), ``RC_LOST``, ``RC_BACK``, ``GCS_LOST``,
``GCS_BACK``, ``YAW_STICK <rad/s>`` (counter-clockwise; 0 is centred), ``THROTTLE <-1 to 1>`` (-1 is zero; 0 holds the height).
"""

from __future__ import annotations

from uav_simulator.autopilot.core import Autopilot
from uav_simulator.autopilot.endpoint import Endpoint
from uav_simulator.autopilot.types import Mode
from uav_simulator.errors import ConfigError

NUMBERS = {"YAW_STICK": "a rate in rad/s", "THROTTLE": "a number from -1 to 1"}


def apply_pilot_word(text: str, autopilot: Autopilot, endpoint: Endpoint) -> None:
    """Execute a word of the pilot's; raises ConfigError for an unknown one."""
    word, _, argument = text.strip().partition(" ")
    if word in Mode.__members__:
        autopilot.set_mode(Mode[word])
    elif word in {"RC_LOST", "RC_BACK"}:
        autopilot.set_rc(lost=word == "RC_LOST")
    elif word in {"GCS_LOST", "GCS_BACK"}:
        endpoint.gcs_present = word == "GCS_BACK"
    elif word == "YAW_STICK":
        autopilot.yaw_stick(_number(word, argument))
    elif word == "THROTTLE":
        autopilot.throttle_stick(_number(word, argument))
    else:
        raise ConfigError(
            f"/sim/pilot: unknown word {text!r}; known are RC_LOST RC_BACK GCS_LOST GCS_BACK {' '.join((*NUMBERS, *Mode.__members__))}"
        )


def _number(word: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ConfigError(f"/sim/pilot: {word} needs {NUMBERS[word]}, not {text!r}") from None
