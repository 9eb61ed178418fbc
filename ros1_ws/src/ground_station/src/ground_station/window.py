"""What was shown and received in the last second of mission clock. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import fmean

from video_stream.wire import NS

WINDOW_NS = NS
RATE_WINDOW_NS = NS // 4
LOSS_WINDOW_NS = NS
BASE_WINDOW_NS = 10 * NS


@dataclass(frozen=True)
class Shown:
    """A frame on the telepilot's screen; ``quality`` None: not compared with anything."""

    stamp_ns: int
    shown_ns: int
    quality: float | None


class Window:
    """Counts; ``now_ns`` never goes back."""

    def __init__(self) -> None:
        self._shown: deque[Shown] = deque()
        self._received: deque[tuple[int, int]] = deque()
        self._delays: deque[tuple[int, int]] = deque()

    def show(self, shown: Shown) -> None:
        """Note a frame that is shown."""
        self._shown.append(shown)

    def receive(self, now_ns: int, size_bytes: int, delay_ns: int) -> None:
        """Note a packet and how long it was under way."""
        self._received.append((now_ns, size_bytes))
        self._delays.append((now_ns, delay_ns))

    def fps(self, now_ns: int) -> float:
        """Return the frames shown in the last second."""
        return float(len(self._recent(now_ns)))

    def quality(self, now_ns: int) -> float | None:
        """Return their mean quality; None if none of them was compared."""
        known = [shown.quality for shown in self._recent(now_ns) if shown.quality is not None]
        return fmean(known) if known else None

    def delay_s(self, now_ns: int) -> float:
        """Return their mean time from exposure to display; 0 without any."""
        delays = [shown.shown_ns - shown.stamp_ns for shown in self._recent(now_ns)]
        return fmean(delays) / NS if delays else 0.0

    def received_bps(self, now_ns: int) -> float:
        """Return the bits of the last quarter of a second, per second."""
        _drop(self._received, now_ns - RATE_WINDOW_NS)
        return 8.0 * sum(size for _, size in self._received) * NS / RATE_WINDOW_NS

    def queue_s(self, now_ns: int) -> float:
        """Return how much longer than the quickest of the last ten seconds the packets of the last 50 ms were under way."""
        _drop(self._delays, now_ns - BASE_WINDOW_NS)
        recent = [delay for when, delay in self._delays if when > now_ns - NS // 20]
        return (fmean(recent) - min(delay for _, delay in self._delays)) / NS if recent else 0.0

    def _recent(self, now_ns: int) -> tuple[Shown, ...]:
        while self._shown and self._shown[0].shown_ns <= now_ns - WINDOW_NS:
            self._shown.popleft()
        return tuple(self._shown)


def _drop(entries: deque[tuple[int, int]], before_ns: int) -> None:
    while entries and entries[0][0] <= before_ns:
        entries.popleft()


class LossMeter:
    """Which part of the packets of the last second has not come, by the gaps in the RTP sequence numbers."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque()
        self._highest: int | None = None

    def add(self, sequence: int, now_ns: int) -> None:
        """Note a 16-bit sequence number; it is taken for the nearest to the highest that was seen."""
        if self._highest is None:
            self._highest = sequence
        extended = self._highest + ((sequence - self._highest + 0x8000) & 0xFFFF) - 0x8000
        self._highest = max(self._highest, extended)
        self._seen.append((now_ns, extended))

    def loss(self, now_ns: int) -> float:
        """Return the part that is missing, 0 to 1; 0 where less than two packets came."""
        _drop(self._seen, now_ns - LOSS_WINDOW_NS)
        numbers = {number for _, number in self._seen}
        if len(numbers) < 2:
            return 0.0
        expected = max(numbers) - min(numbers) + 1
        return max(0.0, 1.0 - len(numbers) / expected)
