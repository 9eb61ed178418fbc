"""What each perception node owes at a fault of its sensor: told in time, never called free, mended after a second."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from uav_msgs.msg import SensorHealth

from perception_core.poses import NS

if TYPE_CHECKING:
    from uav_msgs.msg import Obstacle

    from perception_core.testing.flight import FakeFlight

GOOD = "good"


class FakeSensor(Protocol):
    """A faked sensor that measures well in the mode ``GOOD``."""

    mode: str
    last_good_ns: int


@dataclass(frozen=True)
class Expected:
    """What the node says of a mode: the fault, a part of the sentence; at the latest so long after the last good measurement.

    ``misleads``: what it measures is wrong from the first on; else its measurements are right, and the fault is beside them.
    """

    mode: str
    fault: str
    sentence: str
    within_s: float = 0.45
    misleads: bool = True


def check_fault(flight: FakeFlight, sensor: FakeSensor, expected: Expected, obstacles: list[Obstacle], *, mended_within_s: float) -> None:
    """Break the sensor, mend it, and assert what the node says meanwhile; its function is enabled, and nothing is in the way.

    ``mended_within_s`` counts from the first good measurement.

    From the first misleading measurement on no corridor is called free, before the verdict and after it.
    """
    mode = expected.mode
    flight.run(0.5)
    # What was seen before has arrived with the newest of it.
    assert flight.run(2.0, until=lambda: obstacles and obstacles[-1].header.stamp.to_nsec() == sensor.last_good_ns), mode
    flight.reports.clear()
    sensor.mode, last_good_ns = mode, sensor.last_good_ns
    obstacles.clear()
    assert flight.run(2.0, until=lambda: flight.reports and flight.told_ns(SensorHealth.BROKEN, after_ns=last_good_ns)), mode
    assert flight.reports[0].to == "BROKEN", mode
    broken_ns = flight.told_ns(SensorHealth.BROKEN, after_ns=last_good_ns)
    # Counted from the arrival, at which the node's clock may be some ticks of 20 ms behind.
    assert 0.25 * NS <= broken_ns - last_good_ns <= expected.within_s * NS, mode
    early = [obstacle for obstacle in obstacles if obstacle.header.stamp.to_nsec() != last_good_ns and expected.misleads]
    assert all(obstacle.unknown or obstacle.detected for obstacle in early), mode
    obstacles.clear()
    flight.run(0.5)
    health = flight.health[-1]
    assert (health.verdict, health.fault) == (SensorHealth.BROKEN, expected.fault), mode
    assert expected.sentence in health.reason, mode
    assert all(obstacle.unknown for obstacle in obstacles), mode
    assert bool(obstacles) == (mode != "dead"), mode
    sensor.mode, mended_ns = GOOD, flight.now_ns
    assert flight.run(1.0, until=lambda: sensor.last_good_ns > mended_ns), mode
    first_good_ns = sensor.last_good_ns
    assert flight.run(4.0, until=lambda: flight.reports[1:] and flight.told_ns(SensorHealth.OK, after_ns=mended_ns)), mode
    assert flight.reports[1].to == "OK", mode
    ok_ns = flight.told_ns(SensorHealth.OK, after_ns=mended_ns)
    # Of a second of good ones the last may seem to come before its end, by a clock that is behind by some ticks: then the next one counts.
    assert mended_ns + 1.0 * NS <= ok_ns <= first_good_ns + mended_within_s * NS, mode
