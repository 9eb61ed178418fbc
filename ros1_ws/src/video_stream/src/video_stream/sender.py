"""The drone's end of the video: camera frames in, datagrams out, adapted to the receiver's reports. Pure."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

from video_stream.encoder import Encoder, Rgb
from video_stream.levels import Level, level_for
from video_stream.rate import RateController, RateSettings
from video_stream.report import VideoReport
from video_stream.wire import NS, Mark, Seal, VideoPacket

KEPT_FRAMES = 40
RESEND_AFTER_NS = 150_000_000
GRAIN_NS = 15_000_000  # by so much may a frame come early: cameras are not quite even
UNDER_WAY_S = 0.3  # a frame that was sent so long ago and has not come yet: the radio is full
WINDOW_S = 0.2  # so much of what the radio carries may be under way: what is more only waits, and a lost packet behind it
PROBE_S = 0.4  # one goes out then all the same: only a frame that arrives tells that the way is free again


@dataclass(frozen=True)
class SentFrame:
    """A frame that went out; ``skipped`` camera frames came before it without being sent."""

    frame_id: int
    stamp_ns: int
    size_bytes: int
    key: bool
    datagrams: tuple[bytes, ...]


@dataclass
class _Kept:
    sent_ns: int
    packets: tuple[VideoPacket, ...]
    size_bytes: int
    resent_ns: dict[int, int]


class VideoSender:
    """Encodes, packs, remembers, sends again, adapts."""

    def __init__(self, seal: Seal, settings: RateSettings | None = None) -> None:
        self._seal = seal
        self._encoder = Encoder()
        self._rate = RateController(settings)
        self._kept: OrderedDict[int, _Kept] = OrderedDict()
        self._next_id = 0
        self._sequence = 0
        self._due_ns = 0
        self._sent_ns: int | None = None
        self._want_key = False
        self.level: Level | None = None
        self.report: VideoReport | None = None
        self.heard_ns: int | None = None
        self.adaptations = 0

    @property
    def target_bps(self) -> float:
        """The bit rate that is encoded at."""
        return self._rate.target_bps

    @property
    def exhausted(self) -> bool:
        """Return whether adaptation has given all it has: the lowest level at the lowest bit rate."""
        return self._rate.exhausted

    def frame(self, image: Rgb, stamp_ns: int, now_ns: int) -> SentFrame | None:
        """Encode a camera frame; None when it is left out to keep the frame rate or because the radio is full."""
        self._rate.on_time(now_ns)
        level = level_for(self._rate.target_bps, self.level)
        if stamp_ns + GRAIN_NS < self._due_ns or self._full(now_ns):
            return None
        self.adaptations += self.level is not None and level is not self.level
        self.level = level
        period_ns = int(NS / level.fps)
        self._due_ns = max(self._due_ns, stamp_ns - period_ns) + period_ns
        height, width = image.shape[:2]
        encoded = self._encoder.encode(
            image,
            stamp_ns=stamp_ns,
            size=level.size(width, height),
            bit_rate_bps=self._rate.target_bps,
            fps=level.fps,
            key=self._want_key,
        )
        self._want_key = self._want_key and not encoded.key
        return self._send(encoded.payloads, stamp_ns, now_ns, key=encoded.key, size_bytes=encoded.size_bytes)

    def feedback(self, data: bytes, now_ns: int) -> list[bytes]:
        """Handle a report; return the packets to send again. Raises WireError for what is no report."""
        report = VideoReport.parse(data, self._seal)
        if self.report is not None and report.number <= self.report.number and report.stamp_ns <= self.report.stamp_ns:
            return []  # a replay, or overtaken
        self.report, self.heard_ns = report, now_ns
        self._rate.on_report(report, now_ns)
        self._want_key = self._want_key or report.want_key
        return [data for frame_id, index in report.missing for data in self._again(frame_id, index, now_ns)]

    def _full(self, now_ns: int) -> bool:
        if self.report is None or self._sent_ns is None or now_ns - self._sent_ns >= PROBE_S * NS:
            return False
        waiting = [kept for frame_id, kept in self._kept.items() if frame_id > self.report.newest_id]
        if not waiting:
            return False
        bits = 8 * sum(kept.size_bytes for kept in waiting)
        carried_bps = max(self.report.received_bps, self._rate.target_bps / 4.0)  # little has come while little was sent
        return now_ns - waiting[0].sent_ns > UNDER_WAY_S * NS or bits > WINDOW_S * carried_bps

    def _send(self, payloads: tuple[bytes, ...], stamp_ns: int, now_ns: int, *, key: bool, size_bytes: int) -> SentFrame:
        frame_id = self._next_id
        self._next_id += 1
        packets = tuple(
            VideoPacket(self._number(), Mark(frame_id, stamp_ns, index, len(payloads), key), payload)
            for index, payload in enumerate(payloads)
        )
        datagrams = tuple(packet.sent(now_ns).serialize(self._seal) for packet in packets)
        self._kept[frame_id] = _Kept(now_ns, packets, sum(map(len, datagrams)), {})
        self._sent_ns = now_ns
        while len(self._kept) > KEPT_FRAMES:
            self._kept.popitem(last=False)
        return SentFrame(frame_id, stamp_ns, size_bytes, key, datagrams)

    def _again(self, frame_id: int, index: int, now_ns: int) -> list[bytes]:
        kept = self._kept.get(frame_id)
        if kept is None or index >= len(kept.packets) or now_ns - kept.resent_ns.get(index, 0) < RESEND_AFTER_NS:
            return []
        kept.resent_ns[index] = now_ns
        # The same sequence number: to a player it is a packet that came late.
        return [kept.packets[index].sent(now_ns).serialize(self._seal)]

    def _number(self) -> int:
        self._sequence = (self._sequence + 1) & 0xFFFF
        return self._sequence
