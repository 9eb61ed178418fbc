"""The telepilot's end of the video: datagrams in, pictures and reports out. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import av
import cv2
import numpy as np
from video_stream.report import VideoReport
from video_stream.wire import NS, Seal, VideoPacket, WireError

from ground_station.assembler import Assembler, WholeFrame
from ground_station.quality import Rgb, grey, no_reference, ssim
from ground_station.references import References
from ground_station.window import LossMeter, Shown, Window

REPORT_PERIOD_NS = NS // 20
NO_REFERENCE_EVERY = 10


@dataclass(frozen=True)
class Picture:
    """A decoded frame as it is shown, (H, W, 3) uint8 RGB; ``ssim`` None without a reference."""

    frame_id: int
    stamp_ns: int
    received_ns: int
    shown_ns: int
    size_bytes: int
    image: Rgb
    ssim: float | None


class VideoReceiver:
    """Receives, decodes, measures.

    ``width``, ``height``: of the screen, to which smaller pictures are enlarged; ``references``: to compare with, which only a
    simulation can have.
    """

    def __init__(self, seal: Seal, width: int = 640, height: int = 360, references: References | None = None) -> None:
        self._seal = seal
        self._size = width, height
        self._assembler = Assembler()
        self._decoder = _decoder()
        self._window = Window()
        self._losses = LossMeter()
        self._references = references
        self._number = 0
        self._report_due_ns = 0
        self._shown_id = -1
        self._shown_count = 0
        self._no_reference = 0.0
        self._quality = 0.0
        self.refused = 0
        self.last_refusal = ""

    def datagram(self, data: bytes, now_ns: int) -> bool:
        """Handle a datagram; return whether it is a new packet of the video. Others are counted and dropped."""
        try:
            packet = VideoPacket.parse(data, self._seal)
        except WireError as error:
            self.refused += 1
            self.last_refusal = str(error)
            return False
        new = self._assembler.add(packet, now_ns)
        if new:
            self._losses.add(packet.sequence, now_ns)
            self._window.receive(now_ns, len(data), now_ns - packet.sent_ns)
        return new

    def pictures(self, now_ns: int) -> list[Picture]:
        """Return the frames to show now."""
        return [picture for whole in self._assembler.take(now_ns) for picture in self._decode(whole, now_ns)]

    def report(self, now_ns: int) -> VideoReport | None:
        """Return a report when one is due."""
        if now_ns < self._report_due_ns:
            return None
        self._report_due_ns = now_ns + REPORT_PERIOD_NS
        self._number += 1
        self._note_quality(now_ns)
        return VideoReport(
            number=self._number,
            stamp_ns=now_ns,
            newest_id=self._assembler.newest_id,
            shown_id=self._shown_id,
            fps=self._window.fps(now_ns),
            quality=self._quality,
            no_reference=self._no_reference,
            delay_s=self._window.delay_s(now_ns),
            queue_s=self._window.queue_s(now_ns),
            received_bps=self._window.received_bps(now_ns),
            loss=self._losses.loss(now_ns),
            missing=self._assembler.missing(now_ns),
            want_key=self._assembler.want_key,
        )

    def _note_quality(self, now_ns: int) -> None:
        """Keep the last quality while nothing is shown; without a reference, the other figure on a scale of 0 to 1 stands in."""
        quality = self._window.quality(now_ns)
        if quality is None and not self._references:
            quality = min(max(self._no_reference / 10.0, 0.0), 1.0)
        self._quality = self._quality if quality is None else quality

    def _decode(self, whole: WholeFrame, now_ns: int) -> list[Picture]:
        try:
            frames = self._decoder.decode(av.Packet(whole.data))
        except av.FFmpegError as error:
            self.last_refusal = f"frame {whole.frame_id} can't be decoded: {error}"
            self._decoder = _decoder()
            return []
        return [self._show(whole, frame.to_ndarray(format="rgb24"), now_ns) for frame in frames]

    def _show(self, whole: WholeFrame, decoded: Rgb, now_ns: int) -> Picture:
        image = decoded
        if (decoded.shape[1], decoded.shape[0]) != self._size:
            image = np.asarray(cv2.resize(decoded, self._size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
        reference = None if self._references is None else self._references.find(whole.stamp_ns)
        similarity = None if reference is None else ssim(grey(reference), grey(image))
        if self._shown_count % NO_REFERENCE_EVERY == 0:
            self._no_reference = no_reference(grey(image))
        self._shown_count += 1
        self._shown_id = whole.frame_id
        self._window.show(Shown(whole.stamp_ns, now_ns, similarity))
        return Picture(whole.frame_id, whole.stamp_ns, whole.received_ns, now_ns, whole.size_bytes, image, similarity)


def _decoder() -> av.VideoCodecContext:
    decoder = av.VideoCodecContext.create("h264", "r")
    decoder.thread_count = 1  # a frame that waits for the next one's thread is a frame later on the screen
    return decoder
