"""Drone, radio and ground station together on a clock of their own, without ROS: for benches and tests. Pure."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from radio_link.channel import Channel
from radio_link.conditions import Both
from video_stream.levels import Level
from video_stream.rate import RateSettings
from video_stream.report import VideoReport
from video_stream.sender import VideoSender
from video_stream.wire import NS, Seal

from ground_station.quality import Rgb
from ground_station.receiver import Picture, VideoReceiver
from ground_station.references import References

TICK_NS = NS // 50
FRAME_NS = NS // 20


@dataclass(frozen=True)
class RehearsalMoment:
    """The state of the stream at a report of the ground station."""

    t_s: float
    report: VideoReport
    target_bps: float
    level: Level | None
    exhausted: bool


@dataclass
class Rehearsal:
    """Runs a stream. ``camera(n)``: the n-th picture, 20 a second; ``radio(t_s)``: how the radio is at a time.

    ``late_ns(n)``: how long after its exposure the n-th picture comes to the encoder; by default at once.
    ``tamper``: what is done to the datagrams on their way to the ground; by default nothing.
    """

    camera: Callable[[int], Rgb]
    radio: Callable[[float], Both]
    late_ns: Callable[[int], int] = lambda _: 0
    seed: int = 0
    settings: RateSettings | None = None
    tamper: Callable[[list[bytes]], list[bytes]] = lambda datagrams: datagrams
    pictures: list[Picture] = field(default_factory=list)
    moments: list[RehearsalMoment] = field(default_factory=list)
    encode_s: list[float] = field(default_factory=list)
    decode_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        seal = Seal(b"rehearsal")
        self.sender = VideoSender(seal, self.settings)
        self.references = References()
        self.receiver = VideoReceiver(seal, references=self.references)
        self._seal = seal
        self._filmed: deque[tuple[int, int, Rgb]] = deque()
        both = self.radio(0.0)
        self._down, self._up = Channel(both.down, 2 * self.seed), Channel(both.up, 2 * self.seed + 1)

    def run(self, seconds: float) -> None:
        """Run radio, drone and ground from time 0 for so many seconds of simulated time."""
        frame = 0
        for now_ns in range(TICK_NS, int(seconds * NS) + 1, TICK_NS):
            both = self.radio(now_ns / NS)
            self._down.condition, self._up.condition = both.down, both.up
            self._at_the_ground(now_ns)
            self._at_the_drone(now_ns)
            if now_ns >= frame * FRAME_NS:
                self._filmed.append((now_ns + self.late_ns(frame), now_ns, self.camera(frame)))
                frame += 1
            while self._filmed and self._filmed[0][0] <= now_ns:
                _, stamp_ns, image = self._filmed.popleft()
                self._film(image, stamp_ns, now_ns)

    def gaps(self, start_s: float = 0.0, end_s: float = float("inf")) -> Iterator[float]:
        """Yield the seconds between the pictures that were shown in a time."""
        shown = [picture.shown_ns / NS for picture in self.pictures if start_s <= picture.shown_ns / NS <= end_s]
        yield from (after - before for before, after in pairwise(shown))

    def _at_the_ground(self, now_ns: int) -> None:
        for data in self.tamper(self._down.due(now_ns)):
            self.receiver.datagram(data, now_ns)
        begun = time.perf_counter()
        shown = self.receiver.pictures(now_ns)
        self.decode_s += [(time.perf_counter() - begun) / max(1, len(shown))] * len(shown)
        self.pictures += shown
        report = self.receiver.report(now_ns)
        if report is not None:
            self._up.send(report.pack(self._seal), now_ns)
            self.moments.append(RehearsalMoment(now_ns / NS, report, self.sender.target_bps, self.sender.level, self.sender.exhausted))

    def _at_the_drone(self, now_ns: int) -> None:
        for data in self._up.due(now_ns):
            for again in self.sender.feedback(data, now_ns):
                self._down.send(again, now_ns)

    def _film(self, image: Rgb, stamp_ns: int, now_ns: int) -> None:
        self.references.note(stamp_ns, image)
        begun = time.perf_counter()
        frame = self.sender.frame(image, stamp_ns, now_ns)
        self.encode_s.append(time.perf_counter() - begun)
        for data in frame.datagrams if frame is not None else ():
            self._down.send(data, now_ns)
