"""Private parameters of the node `/radio_link`, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RadioSettings:
    """Private parameters of /radio_link.

    Ten UDP ports on loopback from ``base_port`` on: the radio takes the drone's video (+0), the ground's reports (+2) and the
    ground's control link (+4), and brings them to the ground (+1) and the drone (+3, ``control_to``); what the autopilot answers
    goes to the ground (+8). A player has +6 and, for RTCP, +7.
    """

    base_port: int = 20000
    control_to: int = 0  # UDP port of the autopilot for its ground station; 0: base_port + 5
    world: str = ""  # world file with radio_zones; empty: good everywhere
    law: str = "zones"  # or free_space, two_ray, obstructed: then distance and obstruction decide, not the zones
    station_east_m: float = -2.0  # where the ground station's antenna stands: map
    station_north_m: float = -2.0
    station_height_m: float = 2.0
    faults: str = ""  # as radio@40-55,control@60: seconds after lift-off
    seed: int = 0  # of the chance of the emulation
    log_path: str = ""  # file for a line of JSON whenever the radio changes; empty: none
