"""H.264 in real time: libx264 by PyAV, RFC 6184 payloads by aiortc."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import av
import numpy as np
from aiortc.codecs.h264 import H264Encoder
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]
TIME_BASE = Fraction(1, 1000)
PRESET, TUNE = "veryfast", "zerolatency"
FAITHFUL = "psy=0:aq-mode=2:ref=3"  # what is true of the wall, not what looks crisp; makes good what BUFFER_S costs
BUFFER_S = 0.08  # of the rate control: how unevenly the bits may come
KEY_INTERVAL_S = 4  # a player that joins waits no longer
RETUNE_DOWN, RETUNE_UP = 0.1, 0.25  # smaller changes of the bit rate are left for later: a new encoder begins with a key frame


@dataclass(frozen=True)
class Encoded:
    """One frame: its payloads in order, its bytes, and whether it decodes without others."""

    payloads: tuple[bytes, ...]
    size_bytes: int
    key: bool


class Encoder:
    """Encodes RGB frames; begins again, with a key frame, when size or bit rate have changed enough."""

    def __init__(self, preset: str = PRESET) -> None:
        self._preset = preset
        self._packetizer = H264Encoder()
        self._codec: av.VideoCodecContext | None = None
        self._bit_rate_bps = 0.0
        self._fps = 0.0
        self.restarts = 0

    def encode(self, image: Rgb, *, stamp_ns: int, size: tuple[int, int], bit_rate_bps: float, fps: float, key: bool = False) -> Encoded:
        """Encode an image (H, W, 3) uint8 RGB at a size (width, height) in pixels."""
        codec = self._codec_for(size, bit_rate_bps, fps)
        frame = av.VideoFrame.from_ndarray(image, format="rgb24").reformat(*size, format="yuv420p")
        frame.pts = stamp_ns // 1_000_000
        frame.time_base = TIME_BASE
        frame.pict_type = av.video.frame.PictureType.I if key else av.video.frame.PictureType.NONE
        payloads: list[bytes] = []
        is_key = False
        size_bytes = 0
        for packet in codec.encode(frame):
            payloads += self._packetizer.pack(packet)[0]
            is_key = is_key or packet.is_keyframe
            size_bytes += packet.size
        return Encoded(tuple(payloads), size_bytes, is_key)

    def _codec_for(self, size: tuple[int, int], bit_rate_bps: float, fps: float) -> av.VideoCodecContext:
        codec = self._codec
        low, high = (1.0 - RETUNE_DOWN) * self._bit_rate_bps, (1.0 + RETUNE_UP) * self._bit_rate_bps
        changed = not low < bit_rate_bps < high
        if codec is None or changed or fps != self._fps or (codec.width, codec.height) != size:
            codec = self._codec = _open(size, bit_rate_bps, fps, self._preset)
            self._bit_rate_bps, self._fps = bit_rate_bps, fps
            self.restarts += 1
        return codec


def _open(size: tuple[int, int], bit_rate_bps: float, fps: float, preset: str) -> av.VideoCodecContext:
    codec = av.VideoCodecContext.create("libx264", "w")
    codec.width, codec.height = size
    codec.pix_fmt = "yuv420p"
    codec.framerate = Fraction(round(fps * 1000), 1000)
    codec.time_base = TIME_BASE
    codec.bit_rate = round(bit_rate_bps)
    codec.thread_count = 1
    codec.options = {
        "preset": preset,
        "tune": TUNE,
        "profile": "high",
        "maxrate": str(round(bit_rate_bps)),
        "bufsize": str(round(bit_rate_bps * BUFFER_S)),
        "g": str(round(fps * KEY_INTERVAL_S)),
        "forced-idr": "1",
        "x264-params": f"scenecut=0:bframes=0:{FAITHFUL}",
    }
    return codec
