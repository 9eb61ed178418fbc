"""What the ground station reports back to the drone, twenty times a second, over the same radio."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields

from video_stream.wire import Seal, pack_message, unpack_message

KIND = "report"
MOST_MISSING = 40


@dataclass(frozen=True)
class VideoReport:
    """How the video arrives. Windows are of mission clock and end at ``stamp_ns``.

    Attributes:
        number: counts up from 1; an older one than the last is a replay.
        stamp_ns: when it was made.
        newest_id: the newest frame of which a packet has come, -1 for none.
        shown_id: the newest frame that was shown, -1 for none.
        fps: frames shown in the last second.
        quality: mean SSIM of those against what was sent, or the receiver's own estimate of it where it has no reference.
        no_reference: figure of the last frame that needs no reference (Wang, Sheikh, Bovik 2002), about 1 to 10.
        delay_s: mean time from exposure to display of those.
        queue_s: how long the newest frame was under way longer than the quickest lately: what waits in the radio.
        received_bps: bits of payload and headers in the last quarter of a second, per second.
        loss: part of the packets of the last second that have not come.
        missing: packets to be sent again, as (frame id, index).
        want_key: nothing can be shown before the next key frame.
    """

    number: int
    stamp_ns: int
    newest_id: int = -1
    shown_id: int = -1
    fps: float = 0.0
    quality: float = 0.0
    no_reference: float = 0.0
    delay_s: float = 0.0
    queue_s: float = 0.0
    received_bps: float = 0.0
    loss: float = 0.0
    missing: tuple[tuple[int, int], ...] = ()
    want_key: bool = False

    def pack(self, seal: Seal) -> bytes:
        """Return the report as a datagram, with the seal that shows its sender."""
        values = [round(value, 4) if isinstance(value, float) else value for value in astuple(self)]
        return pack_message(KIND, values, seal)

    @classmethod
    def parse(cls, data: bytes, seal: Seal) -> VideoReport:
        """Read a datagram; raise WireError."""
        values = dict(zip((field.name for field in fields(cls)), unpack_message(KIND, data, seal), strict=True))
        values["missing"] = tuple((frame, index) for frame, index in values["missing"])
        return cls(**values)
