"""The radio's core on a clock of the test's own: what passes, when, and what is lost."""

from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from radio_link.channel import NS, OVERHEAD_BYTES, Channel, Condition
from radio_link.conditions import PRESETS, Quality
from radio_link.laws import LAWS, LinkBudget, condition_by_law, free_space_db, obstructed_db, two_ray_db
from radio_link.radio import FAULTS, Radio, by_zones
from radio_link.vehicle import RadioCarrier

from alula.common.faults import parse_faults
from uav_simulator.world.radio import BoxVolume, CylinderVolume, RadioQuality, RadioZone

IDEAL = Condition(rate_bps=1e6, delay_s=0.05, jitter_s=0.0)
TICK_NS = NS // 50


def carry(channel: Channel, seconds: float, *, rate_bps: float, size: int = 1000) -> list[tuple[int, int, bytes]]:
    """Send packets evenly; return (sent, arrived, data) of those that arrived."""
    gap_ns = int(size * 8 / rate_bps * NS)
    sent: dict[bytes, int] = {}
    arrived = []
    due_ns = 0
    for now_ns in range(0, int(seconds * NS), TICK_NS):
        while due_ns <= now_ns:
            data = len(sent).to_bytes(4, "big") + bytes(size - 4)
            sent[data] = now_ns
            channel.send(data, now_ns)
            due_ns += gap_ns
        arrived += [(sent[data], now_ns, data) for data in channel.due(now_ns)]
    return arrived


def test_an_idle_channel_only_delays():
    channel = Channel(IDEAL, seed=1)
    channel.send(b"x" * 100, 0)
    assert channel.due(NS * 49 // 1000) == []
    assert channel.due(NS * 51 // 1000) == [b"x" * 100]


def test_the_bucket_holds_the_rate():
    channel = Channel(IDEAL, seed=1)
    arrived = carry(channel, 20.0, rate_bps=3e6)
    carried_bps = sum((len(data) + OVERHEAD_BYTES) * 8 for _, _, data in arrived) / 20.0
    assert carried_bps == pytest.approx(1e6, rel=0.02)
    assert channel.dropped > 0, "what does not fit is dropped at the tail"
    assert max(at - sent for sent, at, _ in arrived) / NS < 0.5 + 0.05 + 0.1, "no packet waits longer than the queue lasts"


def test_what_fits_is_carried_whole_and_in_order():
    channel = Channel(dataclasses.replace(IDEAL, jitter_s=0.02), seed=2)
    arrived = carry(channel, 10.0, rate_bps=0.8e6)
    numbers = [int.from_bytes(data[:4], "big") for _, _, data in arrived]
    assert numbers == list(range(len(numbers)))
    assert channel.dropped == channel.lost == 0


def test_reordering_is_only_where_it_is_asked_for():
    channel = Channel(dataclasses.replace(IDEAL, jitter_s=0.03, reorder=0.3), seed=3)
    numbers = [int.from_bytes(data[:4], "big") for _, _, data in carry(channel, 10.0, rate_bps=0.5e6)]
    assert numbers != sorted(numbers)
    assert len(set(numbers)) == len(numbers)


def test_bursts_are_as_long_as_the_chain_says():
    condition = dataclasses.replace(IDEAL, rate_bps=1e8, loss=0.0, burst_loss=1.0, to_bad=0.01, to_good=0.25)
    channel = Channel(condition, seed=4)
    numbers = {int.from_bytes(data[:4], "big") for _, _, data in carry(channel, 100.0, rate_bps=4e6)}
    count = channel.sent - 100
    missing = [n not in numbers for n in range(count)]
    bursts = [len(run) for run in "".join("x" if m else " " for m in missing).split()]
    assert sum(missing) / count == pytest.approx(0.01 / (0.01 + 0.25), rel=0.1), "stationary probability of the bad state"
    assert sum(bursts) / len(bursts) == pytest.approx(1 / 0.25, rel=0.1), "mean length of a burst, packets"


def test_out_lets_nothing_through_and_forgets_what_waits():
    channel = Channel(IDEAL, seed=5)
    for _ in range(20):
        channel.send(bytes(1000), 0)
    channel.condition = PRESETS[Quality.OUT].down
    assert len(channel.due(10 * NS)) < 20
    channel.send(b"late", 11 * NS)
    assert channel.due(20 * NS) == []


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 200), st.integers(1, 1500)), max_size=60), st.integers(0, 3))
def test_nothing_is_invented_doubled_or_early(sends: list[tuple[int, int]], quality: int):
    channel = Channel(PRESETS[list(Quality)[quality]].down, seed=6)
    now_ns, sent_ns, arrived = 0, {}, []
    for number, (gap_ms, size) in enumerate(sends):
        now_ns += gap_ms * 1_000_000
        arrived += [(data, now_ns) for data in channel.due(now_ns)]
        data = number.to_bytes(2, "big") + bytes(size)
        sent_ns[data] = now_ns
        channel.send(data, now_ns)
    arrived += [(data, now_ns + 60 * NS) for data in channel.due(now_ns + 60 * NS)]
    assert len({data for data, _ in arrived}) == len(arrived)
    assert all(at_ns >= sent_ns[data] for data, at_ns in arrived)
    assert channel.sent == len(sends) == len(arrived) + channel.lost + channel.dropped


# --- where and when it is how good --------------------------------------------------------------------------------------

ZONES = (
    RadioZone("far corner", RadioQuality.CRITICAL, CylinderVolume((22.0, 18.0), 5.0, (0.0, 20.0))),
    RadioZone("behind", RadioQuality.DEGRADED, BoxVolume((0.0, 10.0, 0.0), (30.0, 30.0, 9.0))),
)


def test_zones_decide_and_outside_it_is_good():
    place = by_zones(ZONES)
    found = [place(point) for point in ((22.0, 18.0, 3.0), (5.0, 15.0, 3.0), (5.0, 0.0, 3.0), None)]
    assert [(s.quality, s.cause) for s in found] == [
        (Quality.CRITICAL, "far corner"),
        (Quality.DEGRADED, "behind"),
        (Quality.GOOD, ""),
        (Quality.GOOD, ""),
    ]


def test_faults_count_from_lift_off_and_never_make_it_better():
    radio = Radio(by_zones(ZONES), parse_faults("radio:degraded@10-20,radio:out@30,control@40-50", FAULTS))
    seen = {}
    for when_s in (None, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0):
        radio.look((22.0, 18.0, 3.0) if when_s == 15.0 else (5.0, 0.0, 3.0), when_s)
        seen[when_s] = (radio.situation.quality, radio.control_lost)
    good, critical, out = Quality.GOOD, Quality.CRITICAL, Quality.OUT
    assert seen == {
        None: (good, False),
        5.0: (good, False),
        15.0: (critical, False),
        25.0: (good, False),
        35.0: (out, False),
        45.0: (out, True),
        55.0: (out, False),
    }


def test_free_space_at_a_known_point():
    assert free_space_db((0, 0, 0), (1000.0, 0, 0)) == pytest.approx(100.05, abs=0.1), (
        "1 km at 2.4 GHz (ITU-R P.525: 32.4 + 20 log f + 20 log d)"
    )


def test_two_rays_fall_with_the_fourth_power_far_away():
    near, far = (two_ray_db((0, 0, 2.0), (d, 0, 3.0)) for d in (5000.0, 10000.0))
    assert far - near == pytest.approx(40 * math.log10(2), abs=0.2)


def test_an_edge_in_the_way_costs_what_the_recommendation_says():
    box = ((40.0, -50.0, 0.0), (41.0, 50.0, 10.0))
    clear = obstructed_db((0, 0, 2.0), (80.0, 0, 30.0), [box])
    behind = obstructed_db((0, 0, 2.0), (80.0, 0, 3.0), [box])
    assert clear == free_space_db((0, 0, 2.0), (80.0, 0, 30.0))
    assert 20.0 < behind - free_space_db((0, 0, 2.0), (80.0, 0, 3.0)) < 30.0


@pytest.mark.parametrize("name", LAWS)
def test_every_law_gives_less_behind_a_wall_or_farther_away(name: str):
    boxes = [((5.0, 5.0, 0.0), (17.0, 13.0, 9.0))]
    rates = [
        condition_by_law(LAWS[name], (-2.0, -2.0, 2.0), point, boxes, LinkBudget()).down.rate_bps
        for point in ((3.0, 0.0, 3.0), (22.0, 18.0, 3.0), (2000.0, 1500.0, 60.0))
    ]
    assert rates[0] >= rates[1] >= rates[2] >= 0.0
    assert rates[0] > rates[2]


# --- the vehicle --------------------------------------------------------------------------------------------------------


def test_without_a_simulator_the_guidance_says_where_the_vehicle_is_and_when_it_lifted_off():
    vehicle = RadioCarrier()
    vehicle.guided((0.0, 0.0, 0.0), 0, 1.0)
    vehicle.guided((0.0, 0.0, 0.0), 1, 2.0)
    assert vehicle.lift_off_s is None
    vehicle.guided((0.0, 0.0, 0.5), 3, 3.0)
    vehicle.guided((4.0, 0.0, 5.0), 2, 9.0)
    assert (vehicle.point, vehicle.lift_off_s) == ((4.0, 0.0, 5.0), 3.0)


def test_guidance_that_is_heard_in_the_air_first_tells_of_no_lift_off():
    vehicle = RadioCarrier()
    vehicle.guided((0.0, 0.0, 5.0), 2, 3.0)
    assert vehicle.lift_off_s is None


def test_a_simulator_knows_better_than_the_guidance():
    vehicle = RadioCarrier()
    vehicle.simulated_at((1.0, 2.0, 3.0))
    vehicle.simulated_lift_off(None)
    vehicle.guided((9.0, 9.0, 9.0), 1, 4.0)
    vehicle.guided((9.0, 9.0, 9.0), 2, 5.0)
    assert (vehicle.point, vehicle.lift_off_s) == ((1.0, 2.0, 3.0), None)
    vehicle.simulated_lift_off(6.0)
    assert vehicle.lift_off_s == 6.0
