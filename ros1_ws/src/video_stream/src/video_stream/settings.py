"""Private parameters of the node `/video_stream`, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StreamSettings:
    """Private parameters of /video_stream; ports are UDP on loopback."""

    image: str = "/camera/image_raw"  # sensor_msgs/Image, rgb8 or bgr8: the simulated camera or a driver's topic
    source: str = ""  # in place of that topic: a V4L2 device (/dev/video0), or any film or address that FFmpeg reads
    source_width: int = 640  # asked of a device
    source_height: int = 360
    source_fps: float = 20.0
    video_port: int = 20000  # of the radio: where RTP goes
    report_port: int = 20003  # of this node: where the ground station's reports arrive
    key: str = "alula"  # shared with the ground station
    enabled: bool = False
    video_path: str = ""  # folder for sent.mkv and sent.jsonl; empty: nothing is recorded
    max_bps: float = 2.5e6
    min_bps: float = 100e3
