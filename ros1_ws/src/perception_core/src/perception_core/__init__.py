"""What the perception nodes share: poses at a time, straightened sweeps, the corridor ahead, health watches. ROS only in ``ros``."""

from perception_core.corridor import Corridor, Motion, Nearest, Support, corridor_coordinates, direction_of_motion, nearest_obstacle
from perception_core.health import HealthLimits, HealthWatch, Verdict
from perception_core.poses import NS, PoseBuffer, Poses, PoseUnavailableError
from perception_core.sweep import Sweep, deskew

__all__ = [
    "NS",
    "Corridor",
    "HealthLimits",
    "HealthWatch",
    "Motion",
    "Nearest",
    "PoseBuffer",
    "PoseUnavailableError",
    "Poses",
    "Support",
    "Sweep",
    "Verdict",
    "corridor_coordinates",
    "deskew",
    "direction_of_motion",
    "nearest_obstacle",
]
