"""The health watch on a clock of its own."""

from __future__ import annotations

import ast
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception_core import FINE, NS, FaultKind, HealthLimits, HealthWatch, StampJudge, StampLimits, Verdict, broken, unsure

SOURCES = Path(__file__).resolve().parents[2]
TICK = NS // 50
SILENCE = ": the driver has stopped, or its connection is lost"
CLOCKS = ": the sensor's clock is not that of this computer, or the driver stamps wrongly"
SLOW = ": the computer or the connection is too slow, or the sensor's clock is behind"


class Run:
    """Drive a watch at 50 Hz; ``source(t_s)`` is asked at 10 Hz: True good, None silent, a text bad, with a question mark not judged."""

    def __init__(self, source) -> None:
        self.watch, self.source, self.now = HealthWatch(HealthLimits()), source, 100 * NS
        self.start, self.changes = self.now, []

    def go(self, seconds) -> Run:
        for _ in range(round(seconds * 50)):
            self.now += TICK
            if self.now % (NS // 10) == 0:
                said = self.source((self.now - self.start) / NS)
                if said is not None:
                    judge = unsure if said is not True and said.endswith("?") else broken
                    self.watch.take(FINE if said is True else judge(FaultKind.VIEW, said), self.now)
            before = self.watch.verdict
            if self.watch.tick(self.now) is not before:
                self.changes.append(((self.now - self.start) / NS, self.watch.verdict))
        return self


def test_ok_at_the_first_good_measurement() -> None:
    assert Run(lambda _t: True).go(1).changes == [(0.1, Verdict.OK)]


def test_broken_after_five_seconds_of_nothing() -> None:
    run = Run(lambda _t: None).go(4.9)
    assert run.watch.verdict is Verdict.UNKNOWN
    assert run.go(1).changes == [(pytest.approx(5.04, abs=0.03), Verdict.BROKEN)]


def test_without_a_driver_it_is_named_for_as_long_as_it_takes_and_five_seconds_begin_with_the_driver() -> None:
    watch = HealthWatch(HealthLimits())
    for k in range(1000):
        assert watch.tick(k * TICK, missing="no images on /left") is Verdict.UNKNOWN
    assert (watch.fault, watch.reason) == (FaultKind.SILENT, "no images on /left")
    verdicts = [watch.tick(k * TICK) for k in range(1000, 1300)]
    assert verdicts.index(Verdict.BROKEN) == pytest.approx(250, abs=2)
    assert watch.reason == "nothing received yet"


def test_a_driver_that_goes_away_after_it_delivered_is_a_broken_sensor() -> None:
    watch = HealthWatch(HealthLimits())
    watch.take(FINE, 0)
    assert watch.tick(TICK) is Verdict.OK
    verdicts = [watch.tick(k * TICK, missing="no images on /left") for k in range(2, 30)]
    assert verdicts[-1] is Verdict.BROKEN
    assert watch.reason == f"no measurement for 0.35 s{SILENCE}"


@pytest.mark.parametrize("fault", [None, "image is black"])
def test_broken_within_0_45_s_of_the_last_good_one_and_ok_after_1_s(fault) -> None:
    run = Run(lambda t: fault if 2.0 < t < 4.0 else True).go(6)
    assert [verdict for _, verdict in run.changes] == [Verdict.OK, Verdict.BROKEN, Verdict.OK]
    assert 2.35 < run.changes[1][0] <= 2.45
    assert 5.0 <= run.changes[2][0] <= 5.1


def test_one_glitch_breaks_nothing() -> None:
    run = Run(lambda t: "black" if 2.05 < t < 2.25 else True).go(4)
    assert run.changes == [(0.1, Verdict.OK)]


def slow(lost, *, hz, seconds=6.0) -> list[tuple[float, Verdict]]:
    """Return when the verdict of a sensor of few measurements a second changed; ``lost`` says which of them do not come."""
    watch, changes = HealthWatch(HealthLimits()), []
    for k in range(round(seconds * 50)):
        if k % (50 // hz) == 0 and not lost(k // (50 // hz)):
            watch.take(FINE, NS + k * TICK)
        before = watch.verdict
        if watch.tick(NS + k * TICK) is not before:
            changes.append((k / 50, watch.verdict))
    return changes


def test_a_slow_sensor_may_lose_one_measurement_too_and_is_silent_within_a_second() -> None:
    assert slow(lambda k: k == 17, hz=5) == [(0.0, Verdict.OK)]
    went = slow(lambda k: k > 15, hz=5)
    assert [verdict for _, verdict in went] == [Verdict.OK, Verdict.BROKEN]
    assert 3.5 < went[1][0] <= 3.55
    assert [verdict for _, verdict in slow(lambda _k: False, hz=1)] == [Verdict.OK, Verdict.BROKEN]  # too slow, and never flapping


def test_recovery_starts_again_at_each_bad_measurement() -> None:
    run = Run(lambda t: True if t < 1 or (t > 2 and round(t * 10) % 8) else "black").go(8)
    assert [verdict for _, verdict in run.changes] == [Verdict.OK, Verdict.BROKEN]


def test_a_late_tick_waits_for_what_is_still_in_the_socket() -> None:
    run = Run(lambda _t: True).go(1)
    late = run.now + NS
    assert run.watch.tick(late) is Verdict.OK
    run.watch.take(FINE, late)
    assert run.watch.tick(late + TICK) is Verdict.OK
    run.now = late + TICK
    run.source = lambda _t: None
    assert run.go(1).watch.verdict is Verdict.BROKEN


def test_a_clock_that_jumps_back_starts_again() -> None:
    run = Run(lambda _t: True).go(1)
    assert run.watch.tick(5 * NS) is Verdict.UNKNOWN
    run.watch.take(FINE, 5 * NS + TICK)
    assert run.watch.tick(5 * NS + 2 * TICK) is Verdict.OK


def test_two_arrivals_at_one_step_of_a_simulated_clock_have_no_rate() -> None:
    watch = HealthWatch(HealthLimits())
    watch.take(FINE, NS)
    watch.take(FINE, NS)
    assert watch.rate_hz(NS) == 0.0


def test_reasons_rate_and_age() -> None:
    run = Run(lambda t: True if t < 3 else "cloud is empty: 0 returns").go(2.9)
    assert run.watch.reason == ""
    assert run.watch.rate_hz(run.now) == pytest.approx(10.0, abs=0.1)
    run.go(1.0)
    assert (run.watch.reason, run.watch.fault) == ("cloud is empty: 0 returns", FaultKind.VIEW)
    assert run.watch.age_s(run.now) == pytest.approx(1.0, abs=0.05)


def test_what_can_not_be_judged_is_unknown_and_silence_after_it_is_broken() -> None:
    run = Run(lambda t: True if t < 1 else "no texture?" if t < 3 else None).go(5)
    assert [verdict for _, verdict in run.changes] == [Verdict.OK, Verdict.UNKNOWN, Verdict.BROKEN]
    assert (run.watch.fault, run.watch.reason) == (FaultKind.SILENT, f"no measurement for 0.35 s{SILENCE}")
    again = Run(lambda t: True if t < 1 or t > 4 else "no texture?").go(6)
    assert [verdict for _, verdict in again.changes] == [Verdict.OK, Verdict.UNKNOWN, Verdict.OK]
    assert 5.0 <= again.changes[2][0] <= 5.2


def test_from_the_start_not_to_be_judged_stays_unknown() -> None:
    assert Run(lambda _t: "no texture?").go(8).changes == []


@pytest.mark.parametrize(
    ("delay_s", "limits", "sentence"),
    [
        (0.1, StampLimits(), ""),
        (-0.05, StampLimits(), ""),
        (-10.0, StampLimits(), f"the stamp is 10.00 s in the future{CLOCKS}"),
        (0.5, StampLimits(), f"the measurement is 0.50 s old when it arrives{SLOW}"),
        (1.7e9, StampLimits(), f"the measurement is 1700000000.00 s old when it arrives{SLOW}"),
        (0.5, StampLimits(latency_s=0.4), ""),
        (0.0, StampLimits(latency_s=0.4), ""),
        (0.9, StampLimits(latency_s=0.4), f"the measurement is 0.90 s old when it arrives, 0.4 s of which are its known latency{SLOW}"),
    ],
)
def test_stamps_against_their_arrival(delay_s, limits, sentence) -> None:
    now = 2_000_000_000 * NS
    finding = StampJudge(limits).finding(now - round(delay_s * NS), now)
    assert (finding.reason, finding.fault) == (sentence, FaultKind.STAMP if sentence else FaultKind.NONE)


def test_a_finding_says_what_was_measured_and_then_its_likeliest_causes() -> None:
    told = "left image is dark (mean 3)", "too little light", "a covered lens"
    assert broken(FaultKind.EXPOSURE, *told).reason == "left image is dark (mean 3): too little light, or a covered lens"
    assert unsure(FaultKind.EXPOSURE, *told[:2]).reason == "left image is dark (mean 3): too little light"
    assert unsure(FaultKind.EXPOSURE, told[0]).reason == told[0]


SAYS_WHAT_IS_WRONG = {"INFO", "FORMAT"}  # a message that contradicts itself has no other cause


def test_each_finding_of_the_sensors_names_two_causes() -> None:
    without = []
    for package in ("perception_core", "zed_depth", "lidar_obstacles"):
        for path in sorted((SOURCES / package / "src" / package).glob("*.py")):
            for call in ast.walk(ast.parse(path.read_text())):
                if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in {"broken", "unsure"}):
                    continue
                fault, _, *causes = call.args
                listed = any(isinstance(cause, ast.Starred) for cause in causes)
                if not (listed or len(causes) == 2 or (isinstance(fault, ast.Attribute) and fault.attr in SAYS_WHAT_IS_WRONG)):
                    without.append(f"{path.name}:{call.lineno}")
    assert without == []


def test_a_stamp_that_does_not_advance() -> None:
    judge = StampJudge(StampLimits())
    assert judge.finding(NS, NS).ok
    assert judge.finding(NS, NS + NS // 10).reason == ("the stamp does not advance: the driver repeats a measurement, or its clock stands")
    assert [judge.finding(NS - k * NS // 50, NS + NS // 10).fault for k in range(1, 6)] == [FaultKind.STAMP] * 5  # it goes back
    assert judge.finding(NS, NS + NS // 10).ok


@given(st.floats(0.0, 0.6), st.floats(0.0, 0.03), st.integers(0, 1000))
@settings(max_examples=40)
def test_a_steady_latency_never_flaps(latency_s, jitter_s, seed) -> None:
    noise = np.random.default_rng(seed)
    judge, watch = StampJudge(StampLimits()), HealthWatch(HealthLimits())
    changes = []
    for k in range(1500):
        now = 100 * NS + k * TICK
        if k % 5 == 0:
            watch.take(judge.finding(now - round((latency_s + noise.uniform(-jitter_s, jitter_s)) * NS), now), now)
        before = watch.verdict
        if watch.tick(now) is not before:
            changes.append(watch.verdict)
    assert len(changes) <= 2


def test_future_stamps_then_silence_is_noticed_at_once() -> None:
    judge = StampJudge(StampLimits())
    run = Run(lambda _t: True).go(1)
    for k in range(1, 60):
        now = run.now + k * TICK
        if k <= 10 and k % 5 == 0:
            run.watch.take(judge.finding(now + 10 * NS, now), now)
        run.watch.tick(now)
    assert run.watch.verdict is Verdict.BROKEN


@given(st.lists(st.sampled_from([True, None, "bad", "unsure?"]), min_size=1, max_size=80))
@settings(max_examples=60)
def test_never_ok_on_old_and_never_broken_on_fresh_measurements(said) -> None:
    came: list[float] = []

    def source(t):
        what = said[min(round(t * 10) - 1, len(said) - 1)]
        came.extend([] if what is None else [t])
        return what

    run = Run(source)
    for _ in range(5 * len(said)):
        before = run.watch.verdict
        run.go(0.02)
        age_s = run.watch.age_s(run.now)
        if run.watch.verdict is Verdict.OK:
            slow = len(came) > 5 and min(later - earlier for earlier, later in pairwise(came[-6:])) > 0.15
            assert age_s <= (0.75 if slow else 0.35)
        if run.watch.verdict is not Verdict.OK and before is Verdict.OK:
            assert age_s > 0.35
        if run.watch.verdict is Verdict.BROKEN and before is not Verdict.BROKEN:
            assert age_s > 0.35
