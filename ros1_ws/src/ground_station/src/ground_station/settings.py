"""Private parameters of the node `/ground_station`, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GroundStationSettings:
    """Private parameters of /ground_station; ports are UDP on loopback."""

    video_port: int = 20001  # of this node: where RTP arrives from the radio
    report_port: int = 20002  # of the radio: where reports go
    control_port: int = 20004  # of the radio: where the telepilot's MAVLink goes
    telemetry_port: int = 20008  # of this node: where the autopilot's MAVLink arrives from the radio
    player_port: int = 20006  # where the RTP that is the drone's is passed on to any player
    key: str = "alula"  # shared with the drone
    reference: str = ""  # topic of the camera that the drone films with, to compare with; only a simulation has it here
    width: int = 640
    height: int = 360
    video_path: str = ""  # folder for received.mkv and shown.jsonl; empty: nothing is recorded
    heartbeat: bool = True  # the telepilot's control link: heartbeats, and the stick when it is moved
