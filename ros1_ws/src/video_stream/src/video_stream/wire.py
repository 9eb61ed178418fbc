"""What crosses the radio: RTP packets whose header extension names their frame, and sealed messages. RFC 3550, RFC 8285.

Every packet carries the id and the stamp of its frame, its place among the frame's packets, how long after the exposure it was sent, and a
tag that only a holder of the key can make. A player that knows nothing of them skips the extension, as RFC 8285 demands. Frames are put
together by id and place, not by sequence number: what is repeated, late or out of order finds its place or none.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from aiortc.rtp import HeaderExtensionsMap, RtpPacket, pack_header_extensions, unpack_header_extensions

PAYLOAD_TYPE = 96  # dynamic, RFC 3551; the SDP says H264/90000
SSRC = 0x616C756C
CLOCK_HZ = 90_000
NS = 1_000_000_000
MARK_ID, TAG_ID, HELD_ID = 1, 2, 3  # of the elements of the header extension
TAG_BYTES = 8
_HELD = struct.Struct("!H")
_MOST_HELD_MS = 0xFFFF
_MARK = struct.Struct("!IQHH")  # 16 bytes, the most that a one-byte header element can hold
_KEY_FLAG = 0x8000


class WireError(ValueError):
    """A datagram is none of ours: damaged, forged, or of something else."""


@dataclass(frozen=True)
class Mark:
    """Which packet of which frame: ``stamp_ns`` is the mission clock of the camera's exposure; ``key``: decodes without others."""

    frame_id: int
    stamp_ns: int
    index: int
    count: int
    key: bool

    def pack(self) -> bytes:
        """Return the mark's 16 bytes, big-endian."""
        return _MARK.pack(self.frame_id, self.stamp_ns, self.index, self.count | (_KEY_FLAG if self.key else 0))

    @classmethod
    def unpack(cls, data: bytes) -> Mark:
        """Read what `pack` made; raise WireError."""
        if len(data) != _MARK.size:
            raise WireError(f"a frame mark of {len(data)} bytes, not {_MARK.size}")
        frame_id, stamp_ns, index, count = _MARK.unpack(data)
        mark = cls(frame_id, stamp_ns, index, count & ~_KEY_FLAG, bool(count & _KEY_FLAG))
        if mark.index >= mark.count:
            raise WireError(f"packet {mark.index} of {mark.count}")
        return mark


class Seal:
    """Makes and checks tags: HMAC-SHA256, cut to 8 bytes (RFC 2104 allows half of the hash; a tag is worth one second of video)."""

    def __init__(self, key: bytes) -> None:
        self._key = key

    def tag(self, data: bytes) -> bytes:
        """Return the tag of some bytes."""
        return hmac.digest(self._key, data, hashlib.sha256)[:TAG_BYTES]

    def holds(self, data: bytes, tag: bytes) -> bool:
        """Return whether the tag belongs to the bytes."""
        return hmac.compare_digest(self.tag(data), tag)


@dataclass(frozen=True)
class VideoPacket:
    """One RTP packet of a frame; ``payload`` as RFC 6184 says.

    ``held_ms``: from the exposure to this packet's sending, 65535 at most. What the camera, the encoder and the sender's computer take, or
    the wait before it is sent again, is nothing that the radio does.
    """

    sequence: int
    mark: Mark
    payload: bytes
    held_ms: int = 0

    def sent(self, now_ns: int) -> VideoPacket:
        """Return the packet as sent at a moment of mission clock."""
        return replace(self, held_ms=min(max(0, (now_ns - self.mark.stamp_ns) // (NS // 1000)), _MOST_HELD_MS))

    @property
    def sent_ns(self) -> int:
        """When it was sent, mission clock, to the millisecond."""
        return self.mark.stamp_ns + self.held_ms * (NS // 1000)

    @property
    def rtp_timestamp(self) -> int:
        """The frame's stamp on the 90 kHz clock."""
        return (self.mark.stamp_ns * CLOCK_HZ // NS) & 0xFFFFFFFF

    def serialize(self, seal: Seal) -> bytes:
        """Return the RTP datagram: mark and authentication tag in the header's extension."""
        packet = RtpPacket(
            payload_type=PAYLOAD_TYPE,
            marker=int(self.mark.index == self.mark.count - 1),
            sequence_number=self.sequence & 0xFFFF,
            timestamp=self.rtp_timestamp,
            ssrc=SSRC,
            payload=self.payload,
        )
        mark, held = self.mark.pack(), _HELD.pack(self.held_ms)
        return bytes(packet.serialize(_Elements([(MARK_ID, mark), (HELD_ID, held), (TAG_ID, seal.tag(_sealed(packet, mark + held)))])))

    @classmethod
    def parse(cls, data: bytes, seal: Seal) -> VideoPacket:
        """Read a datagram; raise WireError for what is damaged, forged or no RTP."""
        elements = _Elements([])
        try:
            packet = RtpPacket.parse(data, elements)
        except (ValueError, struct.error, IndexError) as error:
            raise WireError(f"no RTP packet: {error}") from error
        found = dict(elements.values)
        if not {MARK_ID, HELD_ID, TAG_ID} <= set(found) or len(found[HELD_ID]) != _HELD.size:
            raise WireError("an RTP packet without a frame mark")
        if not seal.holds(_sealed(packet, found[MARK_ID] + found[HELD_ID]), found[TAG_ID]):
            raise WireError("the tag of an RTP packet is wrong")
        return cls(packet.sequence_number, Mark.unpack(found[MARK_ID]), packet.payload, *_HELD.unpack(found[HELD_ID]))


class _Elements(HeaderExtensionsMap):  # type: ignore[misc]  # aiortc is seen untyped
    """Hands our header elements to the library's packet, and takes them from it."""

    def __init__(self, values: list[tuple[int, bytes]]) -> None:
        super().__init__()
        self.values = values

    def get(self, extension_profile: int, extension_value: bytes) -> None:
        """Take what a packet carries; called by ``RtpPacket.parse``."""
        self.values = list(unpack_header_extensions(extension_profile, extension_value))

    def set(self, _values: object) -> tuple[int, bytes]:
        """Give what a packet shall carry; called by ``RtpPacket.serialize``."""
        profile, value = pack_header_extensions(self.values)
        return int(profile), bytes(value)


def _sealed(packet: RtpPacket, elements: bytes) -> bytes:
    return struct.pack("!HIB", packet.sequence_number, packet.timestamp, packet.marker) + elements + bytes(packet.payload)


def pack_message(kind: str, values: Sequence[object], seal: Seal) -> bytes:
    """Return a sealed message: a JSON list of its kind and values behind its tag."""
    text = json.dumps([kind, *values], separators=(",", ":")).encode()
    return seal.tag(text) + text


def unpack_message(kind: str, data: bytes, seal: Seal) -> list[Any]:
    """Return the values of a sealed message of a kind; raise WireError. A sender that has the key is believed to keep to the format."""
    tag, text = data[:TAG_BYTES], data[TAG_BYTES:]
    if not seal.holds(text, tag):
        raise WireError("the tag of a message is wrong")
    found, *values = json.loads(text)
    if found != kind:
        raise WireError(f"a message of the kind {found}, not {kind}")
    return list(values)


def sdp(port: int) -> str:
    """Return the session description that a player needs to show the stream that arrives at a loopback port (RFC 8866)."""
    return (
        "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=Alula video\r\nc=IN IP4 127.0.0.1\r\nt=0 0\r\n"
        f"m=video {port} RTP/AVP {PAYLOAD_TYPE}\r\na=rtpmap:{PAYLOAD_TYPE} H264/{CLOCK_HZ}\r\n"
        f"a=fmtp:{PAYLOAD_TYPE} packetization-mode=1\r\na=recvonly\r\n"
    )
