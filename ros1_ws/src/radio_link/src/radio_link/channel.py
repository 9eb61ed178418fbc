"""One direction of the radio, packet by packet: token bucket, queue, delay, jitter, random and burst loss. Pure.

A packet passes, in this order: the queue (full: lost), the token bucket, which sends it out at the condition's rate, the air,
where it may be lost (Gilbert 1960, Elliott 1963), and the delay with its jitter. Jitter never changes the order unless
``reorder`` says so: in one queue a packet can't overtake another.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass, replace
from heapq import heappop, heappush

NS = 1_000_000_000
OVERHEAD_BYTES = 28  # IP and UDP headers, which the radio carries, too
BURST_BYTES = 6000


@dataclass(frozen=True, kw_only=True)
class Condition:
    """How one direction is at a moment.

    Attributes:
        rate_bps: bits per second; 0: nothing passes.
        queue_s: how long a packet may wait before it is dropped at the tail.
        delay_s, jitter_s: mean and standard deviation of what the air and the nodes behind it add.
        loss: probability that a packet is lost in the good state.
        burst_loss: the same in the bad state; ``to_bad``, ``to_good``: probability per packet of a change of state.
        reorder: part of the packets that skip the order.
    """

    rate_bps: float
    queue_s: float = 0.5
    delay_s: float = 0.02
    jitter_s: float = 0.002
    loss: float = 0.0
    burst_loss: float = 0.0
    to_bad: float = 0.0
    to_good: float = 1.0
    reorder: float = 0.0

    def scaled(self, part: float) -> Condition:
        """Return the condition with its rate scaled by ``part``."""
        return replace(self, rate_bps=self.rate_bps * part)


class Channel:
    """Carries datagrams; ``now_ns`` is mission clock and never goes back. Nothing happens between two calls."""

    def __init__(self, condition: Condition, seed: int) -> None:
        self.condition = condition
        self._random = random.Random(seed)  # noqa: S311 - chance, not secrecy
        self._queue: deque[tuple[int, bytes]] = deque()
        self._queued_bytes = 0
        self._tokens_bytes = float(BURST_BYTES)
        self._filled_ns: int | None = None
        self._air: list[tuple[int, int, bytes]] = []
        self._last_due_ns = 0
        self._count = 0
        self._bad = False
        self.sent = self.delivered = self.lost = self.dropped = 0

    def send(self, data: bytes, now_ns: int) -> None:
        """Send a datagram from one end."""
        self._advance(now_ns)
        self.sent += 1
        limit_bytes = max(self.condition.rate_bps * self.condition.queue_s / 8.0, float(2 * BURST_BYTES))
        if self.condition.rate_bps <= 0.0 or self._queued_bytes + len(data) > limit_bytes:
            self.dropped += 1
            return
        self._queue.append((now_ns, data))
        self._queued_bytes += len(data)
        self._advance(now_ns)

    def due(self, now_ns: int) -> list[bytes]:
        """Return the datagrams that have arrived at the other end by now."""
        self._advance(now_ns)
        arrived: list[bytes] = []
        while self._air and self._air[0][0] <= now_ns:
            arrived.append(heappop(self._air)[2])
        self.delivered += len(arrived)
        return arrived

    def _advance(self, now_ns: int) -> None:
        """Let out of the queue what the tokens of the time until now pay for; each packet leaves when its last byte is paid."""
        at_ns = now_ns if self._filled_ns is None else self._filled_ns
        rate = self.condition.rate_bps / 8.0
        while self._queue:
            entered_ns, data = self._queue[0]
            cost = len(data) + OVERHEAD_BYTES
            if rate <= 0.0:
                self._clear()
                break
            start_ns = max(at_ns, entered_ns)
            self._tokens_bytes = min(BURST_BYTES, self._tokens_bytes + (start_ns - at_ns) / NS * rate)
            ready_ns = start_ns + int(max(0.0, cost - self._tokens_bytes) / rate * NS)
            if ready_ns > now_ns:
                at_ns = start_ns
                break
            self._tokens_bytes = self._tokens_bytes + (ready_ns - start_ns) / NS * rate - cost
            at_ns = ready_ns
            self._queue.popleft()
            self._queued_bytes -= len(data)
            self._fly(data, ready_ns)
        if at_ns < now_ns:
            self._tokens_bytes = min(max(BURST_BYTES, self._tokens_bytes), self._tokens_bytes + (now_ns - at_ns) / NS * rate)
            at_ns = now_ns
        self._filled_ns = at_ns

    def _clear(self) -> None:
        self.dropped += len(self._queue)
        self._queue.clear()
        self._queued_bytes = 0

    def _fly(self, data: bytes, leaves_ns: int) -> None:
        if self._is_lost():
            self.lost += 1
            return
        condition = self.condition
        delay_s = max(0.0, self._random.gauss(condition.delay_s, condition.jitter_s))
        due_ns = leaves_ns + int(delay_s * NS)
        if self._random.random() >= condition.reorder:
            due_ns = max(due_ns, self._last_due_ns)
            self._last_due_ns = due_ns
        self._count += 1
        heappush(self._air, (due_ns, self._count, data))

    def _is_lost(self) -> bool:
        condition = self.condition
        change = condition.to_good if self._bad else condition.to_bad
        if self._random.random() < change:
            self._bad = not self._bad
        return self._random.random() < (condition.burst_loss if self._bad else condition.loss)
