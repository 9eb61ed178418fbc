"""The node's parameters, with their defaults; those with a range may be changed in flight."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from uav_msgs.msg import FlightLimits

from perception_core import tunable
from perception_core.tunable import KEY, Range


@dataclass(frozen=True)
class GuidanceSettings:
    """Private parameters of /uav_guidance: metres, seconds, radians. What follows from a change begins with the next reference or verdict.

    The upper ends of the first ranges are the vehicle's limits, which the skills know, too: in flight they can only be drawn closer.
    """

    url: str = "tcp:127.0.0.1:5760"
    """MAVLink connection as pymavlink writes it: tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT, /dev/ttyX"""
    baud: int = 921600
    """of a serial port"""

    fence_radius_m: float = tunable(FlightLimits.FENCE_RADIUS_M, 1.0, FlightLimits.FENCE_RADIUS_M, "from home, for targets")
    fence_height_m: float = tunable(FlightLimits.FENCE_HEIGHT_M, 1.0, FlightLimits.FENCE_HEIGHT_M, "above home, for targets")
    fence_floor_m: float = tunable(FlightLimits.FENCE_FLOOR_M, 0.1, 1.0, "above home, least height of a target")
    max_speed_m_s: float = tunable(FlightLimits.MAX_SPEED_M_S, 0.1, FlightLimits.MAX_SPEED_M_S, "that may be asked for")
    max_yaw_rate_rad_s: float = tunable(FlightLimits.MAX_YAW_RATE_RAD_S, 0.05, FlightLimits.MAX_YAW_RATE_RAD_S, "that may be asked for")

    max_accel_m_s2: float = tunable(1.5, 0.2, 4.0, "of the carrot, and for planned braking")
    carrot_lead_m: float = tunable(1.0, 0.2, 5.0, "ahead of the vehicle at which the carrot slows down, or ...")
    carrot_lead_s: float = tunable(1.25, 0.2, 5.0, "... at the reference's speed, if that is more: a vehicle follows about 1 s late")
    yaw_rate_rad_s: float = tunable(0.7, 0.05, FlightLimits.MAX_YAW_RATE_RAD_S, "at which the nose is turned into the travel")
    yaw_aligned_rad: float = tunable(math.radians(10.0), 0.01, 1.0, "from the travel at which the vehicle begins to move")

    obstacle_stop_m: float = tunable(3.0, 1.0, 20.0, "from the vehicle's centre: an obstacle nearer than this makes it brake and hold")
    obstacle_clearance_m: float = tunable(2.0, 1.0, 20.0, "at which it stops; an obstacle farther behind the target is not in the way")
    watch_age_s: float = tunable(0.25, 0.1, 1.0, "since a sensor's last verdict until it counts as silent; sensors send at 10 Hz")
    obstacle_age_s: float = tunable(0.6, 0.1, 2.0, "of a measurement, whose verdict does not count after that")
    obstacle_clear_s: float = tunable(0.5, 0.0, 10.0, "for which the way must be clear before it goes on")

    reached_m: float = tunable(0.1, 0.01, 1.0, "from the target at which nothing remains to be done")
    reached_rad: float = tunable(math.radians(2.0), 0.005, 0.5, "from the heading at which nothing remains to be done")
    link_lost_s: float = tunable(2.0, 0.5, 30.0, "of silence after which the link counts as lost")

    position_lost_s: float = tunable(0.7, 0.3, 10.0, "without a fix of the GPS after which the position counts as lost; it tells at 5 Hz")

    disarm_standing: bool = field(
        default=True, metadata={KEY: Range(0, 1, "stop the motors of a vehicle that stands on the ground in a landing that does not end")}
    )

    follow_map: bool = field(default=True, metadata={KEY: Range(0, 1, "fly by the SLAM's map; off: by the autopilot's local position")})
    map_rate_m_s: float = tunable(0.2, 0.01, 2.0, "at which the vehicle's place in the map is corrected in flight")
    map_rate_rad_s: float = tunable(math.radians(2.0), 0.001, 0.5, "at which its heading in the map is corrected in flight")
    map_height_m: float = tunable(0.2, 0.0, 10.0, "up to which any change of the map's height against the autopilot's is followed at once")
    map_height_m_s: float = tunable(0.03, 0.0, 1.0, "at which a change that goes on is followed: a barometer that drifts")
    map_height_most_m: float = tunable(2.0, 0.0, 100.0, "of such changes in a flight: what goes on farther may be the map")
    map_jump_m: float = tunable(1.0, 0.1, 100.0, "of correction, from which on it is taken at once and the reference begins again")
    map_jump_rad: float = tunable(math.radians(10.0), 0.01, math.pi, "of correction, likewise")

    def lead_m(self, speed_m_s: float) -> float:
        """Return how far ahead of a vehicle that does not follow the carrot comes to rest."""
        return max(self.carrot_lead_m, self.carrot_lead_s * speed_m_s) + speed_m_s**2 / (2.0 * self.max_accel_m_s2)
