"""Writes pictures into a film that any player opens, near enough to the originals to measure them again. Pure."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av

from video_stream.encoder import Rgb

QUALITY_CRF = 10  # SSIM above 0.99 to the original


class Film:
    """A Matroska file; playable up to the last second also when the writer was killed. ``size``: (width, height) in pixels."""

    def __init__(self, path: Path, size: tuple[int, int]) -> None:
        # 'live' has the container written as it comes, so that a killed writer leaves a file that plays.
        self._container = av.open(str(path), "w", format="matroska", options={"live": "1"})
        stream = self._container.add_stream("libx264", rate=30)
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        stream.codec_context.thread_count = 1
        stream.options = {"preset": "ultrafast", "tune": "zerolatency", "crf": str(QUALITY_CRF), "g": "20"}
        self._stream = stream
        self._last_ms = -1
        self._begun_ns: int | None = None
        self.count = 0

    def add(self, image: Rgb, stamp_ns: int) -> int:
        """Add a picture (H, W, 3) uint8 RGB shown at a moment of mission clock; return its number, from 0."""
        begun_ns = self._begun_ns = stamp_ns if self._begun_ns is None else self._begun_ns
        # Two pictures of one moment are a millisecond apart: a film has one at a time.
        self._last_ms = max(self._last_ms + 1, (stamp_ns - begun_ns) // 1_000_000)
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        frame.pts = self._last_ms
        frame.time_base = Fraction(1, 1000)
        for packet in self._stream.encode(frame):
            self._container.mux(packet)
        self.count += 1
        return self.count - 1

    def close(self) -> None:
        """Write the frames that the encoder still holds, and close the file."""
        for packet in self._stream.encode(None):
            self._container.mux(packet)
        self._container.close()
