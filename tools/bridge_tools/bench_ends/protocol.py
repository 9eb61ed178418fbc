"""What an end of the benchmark and the benchmark say to each other, and what both ends do alike. No ROS in here.

An end reads its order as one JSON argument and reports events as JSON lines. A sender sends probes (stamp 0) until it reads ``go``, then
what was ordered; a receiver reports ``first`` when every topic has brought a probe, and its figures when it reads ``finish``. Times are
the machine's steady clock, which all processes share.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

Order = dict[str, Any]
STAMP_CHARACTERS = 16
PROBE_EVERY_S = 0.05
WITHOUT_A_LIMIT = 0.0


def read_order() -> Order:
    """Return the order of this process."""
    order: Order = json.loads(sys.argv[1])
    return order


def report(**event: object) -> None:
    """Write an event as a line of JSON on stdout, for the bench that started this process."""
    sys.stdout.write(json.dumps(event) + "\n")
    sys.stdout.flush()


def wait_for(word: str) -> None:
    """Read lines until the word comes; end the process, from any of its threads, when the bench is gone."""
    for line in sys.stdin:
        if line.strip() == word:
            return
    os._exit(1)


def text_stamp(time_ns: int) -> str:
    """Return a time as the 16 characters that a text begins with."""
    return f"{time_ns:016x}"


def read_text_stamp(text: str) -> int:
    """Return the time that a text begins with."""
    return int(text[:STAMP_CHARACTERS], 16)


class Meter:
    """What has arrived, and how long it took."""

    def __init__(self, topics: Iterable[str]) -> None:
        """Wait for a probe of each topic."""
        self._silent = set(topics)
        self._durations_ns: list[int] = []
        self._first_ns = self._last_ns = 0

    def take(self, topic: str, sent_ns: int) -> None:
        """Count a message, or a probe, which has no time of sending."""
        now_ns = time.monotonic_ns()
        if sent_ns:
            self._first_ns = self._first_ns or now_ns
            self._last_ns = now_ns
            self._durations_ns.append(now_ns - sent_ns)
        elif topic in self._silent:
            self._silent.discard(topic)
            if not self._silent:
                report(event="first", time_ns=now_ns)

    @property
    def received(self) -> int:
        """How many messages have arrived."""
        return len(self._durations_ns)

    def figures(self) -> dict[str, float]:
        """Return number, percentiles in ms, and messages a second from the first to the last."""
        span_s = (self._last_ns - self._first_ns) / 1e9
        rate = (self.received - 1) / span_s if self.received > 1 and span_s > 0 else 0.0
        return {"received": self.received, "rate_hz": rate, **percentiles(self._durations_ns)}


def percentiles(durations_ns: Sequence[int]) -> dict[str, float]:
    """Return p50, p95 and p99 in ms; nothing of nothing."""
    ordered = sorted(durations_ns)
    return {f"p{part}_ms": ordered[min(len(ordered) - 1, len(ordered) * part // 100)] / 1e6 for part in (50, 95, 99) if ordered}


def send(order: Order, publish: Sequence[Callable[[Any], None]], message: Any, stamp: Callable[[Any, int], None]) -> None:
    """Send probes until told to go, then ``number`` rounds at ``rate_hz``, or as many as fit into ``seconds`` when the rate is 0."""
    listener = _send_probes(publish, message, stamp)
    start_s = time.monotonic()
    end_s = start_s + order["seconds"] if order["rate_hz"] == WITHOUT_A_LIMIT else float("inf")
    sent = 0
    while sent < order["number"] and time.monotonic() < end_s:
        if order["rate_hz"] != WITHOUT_A_LIMIT:
            time.sleep(max(0.0, start_s + sent / order["rate_hz"] - time.monotonic()))
        for each in publish:
            stamp(message, time.monotonic_ns())
            each(message)
        sent += 1
    report(event="sent", number=sent * len(publish), seconds=time.monotonic() - start_s)
    listener.join()  # until the bench tells it to finish: what was sent last may still be in this process


def _send_probes(publish: Sequence[Callable[[Any], None]], message: Any, stamp: Callable[[Any, int], None]) -> threading.Thread:
    """Send probes until told to go; return the thread that ends when told to finish."""
    go = threading.Event()

    def listen() -> None:
        wait_for("go")
        go.set()
        wait_for("finish")

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    stamp(message, 0)
    while not go.wait(PROBE_EVERY_S):
        for each in publish:
            each(message)
    return listener


def receive(meter: Meter) -> None:
    """Count until told to finish; ``count`` asks how many so far."""
    report(event="ready")
    for line in sys.stdin:
        if line.strip() == "count":
            report(event="count", received=meter.received)
        elif line.strip() == "finish":
            report(event="figures", **meter.figures())
            return


def call(order: Order, call_once: Callable[[bool], bool]) -> None:
    """Call as often as ordered, one call behind the other, and check each answer."""
    call_once(True)
    report(event="ready")
    wait_for("go")
    durations_ns = []
    good = 0
    for index in range(order["number"]):
        start_ns = time.monotonic_ns()
        good += call_once(index % 2 == 0) == (index % 2 == 0)
        durations_ns.append(time.monotonic_ns() - start_ns)
    report(event="figures", received=good, **percentiles(durations_ns))
