"""What the perception nodes share: poses at a time, straightened sweeps, the corridor ahead, health watches. ROS only in ``ros``."""

from perception_core.corridor import (
    Ahead,
    Corridor,
    Nearest,
    Support,
    VehicleMotion,
    corridor_coordinates,
    direction_of_motion,
)
from perception_core.health import FINE, FaultKind, Finding, HealthLimits, HealthWatch, Verdict, broken, first_trouble, unsure
from perception_core.poses import NS, PoseBuffer, Poses, PoseUnavailableError
from perception_core.stamps import StampJudge, StampLimits
from perception_core.sweep import Sweep, SweepStamps, deskew, straighten
from perception_core.tunable import SettingsError, tunable
from perception_core.turns import TurnJoiner

__all__ = [
    "FINE",
    "NS",
    "Ahead",
    "Corridor",
    "FaultKind",
    "Finding",
    "HealthLimits",
    "HealthWatch",
    "Nearest",
    "PoseBuffer",
    "PoseUnavailableError",
    "Poses",
    "SettingsError",
    "StampJudge",
    "StampLimits",
    "Support",
    "Sweep",
    "SweepStamps",
    "TurnJoiner",
    "VehicleMotion",
    "Verdict",
    "broken",
    "corridor_coordinates",
    "deskew",
    "direction_of_motion",
    "first_trouble",
    "straighten",
    "tunable",
    "unsure",
]
