"""What the benchmark measures, and what the official bridge was measured to do with the same cases (in another run, see README.md)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

FLAT_OUT = 0.0
AS_MANY_AS_FIT = 10_000_000
ROS1_TYPES = {"string": "std_msgs/String", "image": "sensor_msgs/Image", "cloud": "sensor_msgs/PointCloud2"}
STRING_BYTES, IMAGE_BYTES, CLOUD_BYTES = 64, 1280 * 720 * 4, 480_000


class Way(Enum):
    """Where messages are sent from and to, or calls; the two last are floors, without a bridge."""

    UP = "1 to 2"
    DOWN = "2 to 1"
    ROS1 = "1 to 1"
    ROS2 = "2 to 2"

    @property
    def worlds(self) -> tuple[int, int]:
        """The worlds of the sending and the receiving end, or of client and server."""
        first, _, second = self.value.split()
        return int(first), int(second)

    @property
    def bridged(self) -> bool:
        """Whether a bridge is in between."""
        return self in {Way.UP, Way.DOWN}


@dataclass(frozen=True)
class TopicCase:
    """Messages of one kind at a rate, on one or several topics.

    ``small_segments``: the ROS 2 ends keep Fast DDS's defaults; ``queue`` is their depth.
    """

    name: str
    kind: str
    size_bytes: int
    rate_hz: float
    seconds: float
    way: Way
    topics: int = 1
    small_segments: bool = True
    queue: int = 10

    @property
    def number(self) -> int:
        """How many messages are sent on each topic."""
        return AS_MANY_AS_FIT if self.rate_hz == FLAT_OUT else round(self.rate_hz * self.seconds)


@dataclass(frozen=True)
class ServiceCase:
    """Calls of a SetBool service, one behind the other; from the client's world to the server's."""

    name: str
    calls: int
    way: Way
    persistent: bool = False


Case = TopicCase | ServiceCase


def all_cases(seconds: float) -> list[Case]:
    """Return all cases; paced ones send for that many seconds."""
    ways = tuple(Way)
    bridged = (Way.UP, Way.DOWN)
    cases: list[Case] = [TopicCase("string", "string", STRING_BYTES, 1000.0, seconds, way) for way in ways]
    cases += [TopicCase("string, deep queue", "string", STRING_BYTES, 1000.0, seconds, way, queue=10_000) for way in bridged]
    for small, name in ((True, "image"), (False, "image, large segments")):
        cases += [
            TopicCase(name, "image", IMAGE_BYTES, 15.0, seconds, way, small_segments=small) for way in ways if small or way is not Way.ROS1
        ]
    cases += [TopicCase("cloud", "cloud", CLOUD_BYTES, 20.0, seconds, way) for way in ways]
    flat_s = seconds / 2
    cases += [TopicCase("string flat out", "string", STRING_BYTES, FLAT_OUT, flat_s, way) for way in ways]
    for small, name in ((True, "image flat out"), (False, "image flat out, large segments")):
        cases += [
            TopicCase(name, "image", IMAGE_BYTES, FLAT_OUT, flat_s, way, small_segments=small)
            for way in ways
            if small or way is not Way.ROS1
        ]
    cases += [
        TopicCase(f"{topics} topics", "string", STRING_BYTES, 50.0, flat_s, way, topics) for topics in (1, 10, 100) for way in bridged
    ]
    calls = round(50 * seconds)
    cases += [ServiceCase("SetBool", calls, way) for way in (Way.DOWN, Way.UP, Way.ROS1, Way.ROS2)]
    return [
        *cases,
        ServiceCase("SetBool, persistent", calls, Way.UP, persistent=True),
        ServiceCase("SetBool, persistent", calls, Way.ROS1, persistent=True),
    ]


@dataclass(frozen=True)
class Official:
    """The official bridge's figures of a case, as text."""

    received: str = ""
    p50_p95_ms: str = ""
    cpu_s_peak_mb: str = ""


OFFICIAL: dict[tuple[str, Way], Official] = {
    ("string", Way.UP): Official("10000 of 10000", "0.32 / 0.45", "1.18, 70"),
    ("string", Way.DOWN): Official("10000 of 10000", "0.18 / 0.35", "1.17, 70"),
    ("image", Way.UP): Official("150 of 150", "55 / 80", "0.96, 92"),
    ("image", Way.DOWN): Official("7 of 150", "14.6 / 16.2", "0.15, 82"),
    ("image, large segments", Way.UP): Official("150 of 150", "13 / -"),
    ("image, large segments", Way.DOWN): Official("150 of 150", "13 / -"),
    ("cloud", Way.UP): Official("200 of 200", "2.8 / 3.2", "0.23, 71"),
    ("cloud", Way.DOWN): Official("200 of 200", "2.4 / 2.8", "0.29, 70"),
    ("string flat out", Way.UP): Official("7700 / s"),
    ("string flat out", Way.DOWN): Official("19900 / s"),
    ("image flat out", Way.UP): Official("46 / s", "", "-, 162"),
    ("image flat out", Way.DOWN): Official("132 / s", "", "-, 162"),
    ("SetBool", Way.DOWN): Official("all", "1.14 / 1.59"),
    ("SetBool", Way.UP): Official("all", "1.59 / 1.86"),
    ("string", Way.ROS1): Official("", "0.05 / -"),
    ("string", Way.ROS2): Official("", "0.17 / -"),
    ("image", Way.ROS1): Official("", "8.0 / -"),
    ("image", Way.ROS2): Official("", "62 / -"),
    ("cloud", Way.ROS1): Official("", "1.4 / -"),
    ("cloud", Way.ROS2): Official("", "2.2 / -"),
    ("SetBool", Way.ROS1): Official("", "0.91 / -"),
    ("SetBool", Way.ROS2): Official("", "0.21 / -"),
    ("SetBool, persistent", Way.ROS1): Official("", "0.09 / -"),
}
OFFICIAL_START_S, OFFICIAL_IDLE_PERCENT = 1.8, 0.4
