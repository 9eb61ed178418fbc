"""From packets to whole frames in the order in which they can be decoded. Pure."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

from aiortc.codecs.h264 import h264_depayload
from video_stream.report import MOST_MISSING
from video_stream.wire import NS, VideoPacket

TIMEOUT_NS = NS // 2  # how long a frame that others wait for may still be sent again
MOST_WAITING = 60


@dataclass(frozen=True)
class WholeFrame:
    """A frame all of whose packets have come; ``data`` is an H.264 access unit with start codes (Annex B)."""

    frame_id: int
    stamp_ns: int
    key: bool
    received_ns: int
    data: bytes
    size_bytes: int


@dataclass
class _Partial:
    stamp_ns: int
    key: bool
    count: int
    begun_ns: int
    last_ns: int = 0
    payloads: dict[int, bytes] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        return len(self.payloads) == self.count


class Assembler:
    """Collects packets; gives out frames of which each can be decoded after the last one that was given out.

    A frame whose predecessor is missing waits for it, at most 0.5 s; then everything up to the next key frame is dropped:
    a picture that was predicted from one that never came would be wrong.
    """

    def __init__(self) -> None:
        self._partial: OrderedDict[int, _Partial] = OrderedDict()
        self._next_id: int | None = None  # None: nothing can be decoded before a key frame
        self._given_id = -1
        self._given_stamp_ns = -1
        self.newest_id = -1
        self.dropped = 0

    @property
    def want_key(self) -> bool:
        """Return whether only a key frame helps."""
        return self._next_id is None and self.newest_id >= 0

    def add(self, packet: VideoPacket, now_ns: int) -> bool:
        """Add a packet; return whether it is new."""
        mark = packet.mark
        if mark.frame_id <= self._given_id:
            if mark.stamp_ns <= self._given_stamp_ns:
                return False
            self._restart()  # a sender that was started again counts from 0, but its time goes on
        partial = self._partial.get(mark.frame_id)
        if partial is None:
            partial = self._partial[mark.frame_id] = _Partial(mark.stamp_ns, mark.key, mark.count, now_ns)
        if mark.index in partial.payloads or mark.count != partial.count:
            return False
        partial.payloads[mark.index] = packet.payload
        partial.last_ns = now_ns
        self.newest_id = max(self.newest_id, mark.frame_id)
        return True

    def take(self, now_ns: int) -> list[WholeFrame]:
        """Return the frames that can be decoded now, in order."""
        frames: list[WholeFrame] = []
        while (frame_id := self._ready(now_ns)) is not None:
            partial = self._partial[frame_id]
            self._forget_until(frame_id)
            frames.append(_whole(frame_id, partial))
            self._given_id, self._given_stamp_ns, self._next_id = frame_id, partial.stamp_ns, frame_id + 1
        return frames

    def missing(self, now_ns: int) -> tuple[tuple[int, int], ...]:
        """Return the packets that others have overtaken: (frame id, index), a frame of which nothing came as its first."""
        if self._next_id is None:
            return ()
        wanted: list[tuple[int, int]] = []
        for frame_id in range(self._next_id, self.newest_id + 1):
            partial = self._partial.get(frame_id)
            if partial is None:
                wanted.append((frame_id, 0))
            else:
                overdue = frame_id < self.newest_id or now_ns - partial.last_ns > NS // 20
                last = partial.count if overdue else max(partial.payloads)
                wanted += [(frame_id, index) for index in range(last) if index not in partial.payloads]
            if len(wanted) >= MOST_MISSING:
                break
        return tuple(wanted[:MOST_MISSING])

    def _restart(self) -> None:
        self._partial.clear()
        self._given_id = self.newest_id = -1
        self._next_id = None

    def _ready(self, now_ns: int) -> int | None:
        partial = None if self._next_id is None else self._partial.get(self._next_id)
        if partial is not None and partial.whole:
            return self._next_id
        # A whole key frame needs no other frame; it overtakes only what has been waited for long enough.
        keys = [frame_id for frame_id, p in self._partial.items() if p.whole and p.key and frame_id > self._given_id]
        late = self._late(now_ns)
        if self._next_id is not None and late:
            self._next_id = None
        if keys and self._next_id is None:
            return min(keys)
        return None

    def _late(self, now_ns: int) -> bool:
        """Return whether newer frames have waited too long for the next one."""
        newer = [p.begun_ns for frame_id, p in self._partial.items() if self._next_id is not None and frame_id >= self._next_id]
        return len(self._partial) > MOST_WAITING or (bool(newer) and now_ns - min(newer) > TIMEOUT_NS and self._behind())

    def _behind(self) -> bool:
        return self._next_id is not None and self.newest_id > self._next_id

    def _forget_until(self, frame_id: int) -> None:
        for old in [known for known in self._partial if known <= frame_id]:
            self.dropped += old != frame_id
            del self._partial[old]


def _whole(frame_id: int, partial: _Partial) -> WholeFrame:
    payloads = [partial.payloads[index] for index in range(partial.count)]
    data = b"".join(h264_depayload(payload) for payload in payloads)
    return WholeFrame(frame_id, partial.stamp_ns, partial.key, partial.last_ns, data, sum(map(len, payloads)))
