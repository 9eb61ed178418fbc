"""The IMU that is of no use to the mapping any more: silent, late, refused, frozen; what is told, and what the map is then built of."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidar_mapping.core import LidarMapping
from lidar_mapping.imu_watch import BROKEN_NS, ImuWatch, unchanging
from lidar_mapping.inertial import ImuReading
from lidar_mapping.settings import MappingSettings
from perception_core import NS

SWEEP_NS = NS // 10


def alive(stamp_ns: int, seed: int = 0) -> ImuReading:
    chance = np.random.default_rng([seed, stamp_ns])
    return ImuReading(stamp_ns, chance.normal(0.0, 0.003, 3), chance.normal([0.0, 0.0, 9.81], 0.05))


def sweeps(watch: ImuWatch, spoil, *, count: int = 40, from_sweep: int = 10, hz: float = 100.0) -> float | None:
    """Let the watch judge sweeps of 0.1 s, from one on with what ``spoil`` makes of them; return when it has told, s after that."""
    for number in range(1, count + 1):
        end_ns = number * SWEEP_NS
        stamps = range(end_ns - SWEEP_NS, end_ns, round(NS / hz))
        readings = [alive(stamp_ns) for stamp_ns in stamps if stamp_ns > 0]
        watch.fails(end_ns, spoil(readings) if number > from_sweep else readings)
        if watch.problem:
            return (end_ns - from_sweep * SWEEP_NS) / NS
    return None


def frozen(readings):
    return [ImuReading(one.stamp_ns, np.full(3, 0.01), np.array([0.0, 0.1, 9.8])) for one in readings]


def flickering(readings):
    return [ImuReading(one.stamp_ns, np.array([one.rates[0], 0.0, 0.0]), np.array([0.0, 0.1, 9.8])) for one in readings]


def late(readings):
    return [alive(one.stamp_ns - NS // 2) for one in readings]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda _: [], "no reading has come for a second"),
        (frozen, "its readings do not change"),
        (flickering, "its readings do not change"),
        (late, "its readings come too late: the newest is 0.5 s old at the end of a sweep"),
    ],
)
@pytest.mark.parametrize("hz", [25.0, 100.0, 400.0])
def test_an_imu_that_is_of_no_use_is_told_after_a_second_with_what_is_wrong(spoil, said, hz):
    watch = ImuWatch()
    assert sweeps(watch, spoil, hz=hz) == pytest.approx(1.0, abs=0.11)
    assert watch.problem == said
    watch.fails(50 * SWEEP_NS, [alive(50 * SWEEP_NS - 1), alive(50 * SWEEP_NS)])
    assert watch.problem == said, "what was found stays"


def test_readings_that_can_not_be_any_are_told_with_the_last_of_them():
    watch = ImuWatch()

    def refused(_):
        watch.refuse("0 m/s2")
        return []

    assert sweeps(watch, refused) == pytest.approx(1.0, abs=0.11)
    assert watch.problem == "10 readings in a row can't be any: 0 m/s2"


def test_half_a_second_without_readings_and_a_clock_that_is_set_back_are_no_failure():
    watch = ImuWatch()
    for number in (*range(1, 20), *range(25, 40), *range(1, 20)):
        watch.fails(number * SWEEP_NS, [alive(number * SWEEP_NS - 1), alive(number * SWEEP_NS)])
    for number in range(20, 25):
        watch.fails(number * SWEEP_NS, [])
    assert watch.problem == ""


@given(st.lists(st.booleans(), min_size=1, max_size=80))
def test_it_is_told_exactly_when_no_sweep_has_had_readings_for_a_second(heard: list[bool]):
    watch, useful_ns, newest, told = ImuWatch(), SWEEP_NS, None, False
    for number, is_heard in enumerate(heard, 1):
        end_ns = number * SWEEP_NS
        watch.fails(end_ns, [alive(end_ns - 1), alive(end_ns)] if is_heard else [])
        newest = number if is_heard else newest
        if newest is not None and number - newest <= 1:  # sweeps of 0.1 s: the newest reading is not older than that
            useful_ns = end_ns
        told |= end_ns - useful_ns >= BROKEN_NS
        assert bool(watch.problem) == told


@given(st.integers(0, 2**32), st.integers(2, 50))
def test_readings_of_a_sensor_with_noise_change(seed: int, count: int):
    assert not unchanging([alive(stamp_ns, seed) for stamp_ns in range(count)])


class Host:
    def __init__(self) -> None:
        self.told: list[tuple[str, str]] = []
        self.warned: list[str] = []

    def report(self, resource: str, state: str, reason: str = "") -> None:
        if resource == "mapping.imu_status":
            self.told.append((state, reason))

    def warn(self, about: str, words: str, **_how: object) -> None:
        if about == "imu":
            self.warned.append(words)

    def publish(self, *_what: object) -> None:
        pass

    def now_ns(self) -> int:
        return 0


def test_the_mapping_tells_once_and_uses_the_imu_no_more_until_it_begins_again():
    host = Host()
    core = LidarMapping(MappingSettings(resume=False), host)
    core._vehicle = SimpleNamespace(poses=None)
    core.switch(True)
    assert host.told == [("OK", "")]
    good = [[alive(number * SWEEP_NS + 1), alive(number * SWEEP_NS + 2)] for number in range(61)]
    used = [len(core._usable(good[number] if number < 20 else frozen(good[number]), number * SWEEP_NS)) for number in range(1, 40)]
    assert used == [2] * 20 + [0] * 19, "the first sweep that is still differs from the one before it"
    assert [len(core._usable(good[number], number * SWEEP_NS)) for number in range(40, 60)] == [0] * 20
    assert host.told[1:] == [("BROKEN", "its readings do not change")]
    assert host.warned == ["the IMU is not used any more in this mapping: its readings do not change"]
    core.switch(False)
    assert len(host.told) == 2, "what was found stays after the mapping"
    core.switch(True)
    assert host.told[2:] == [("OK", "")]
    assert len(core._usable(good[60], 60 * SWEEP_NS)) == 2
