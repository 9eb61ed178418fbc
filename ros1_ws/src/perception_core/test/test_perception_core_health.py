"""The health watch on a clock of its own."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception_core import NS, HealthLimits, HealthWatch, Verdict

TICK = NS // 50


class Run:
    """Drive a watch at 50 Hz; ``source(t_s)`` is asked at 10 Hz: True good, None silent, a text bad."""

    def __init__(self, source) -> None:
        self.watch, self.source, self.now = HealthWatch(HealthLimits()), source, 100 * NS
        self.start, self.changes = self.now, []

    def go(self, seconds) -> Run:
        for _ in range(round(seconds * 50)):
            self.now += TICK
            if self.now % (NS // 10) == 0:
                said = self.source((self.now - self.start) / NS)
                if said is True:
                    self.watch.good(self.now)
                elif said is not None:
                    self.watch.bad(said)
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


@pytest.mark.parametrize("fault", [None, "image is black"])
def test_broken_within_0_45_s_of_the_last_good_one_and_ok_after_1_s(fault) -> None:
    run = Run(lambda t: fault if 2.0 < t < 4.0 else True).go(6)
    assert [verdict for _, verdict in run.changes] == [Verdict.OK, Verdict.BROKEN, Verdict.OK]
    assert 2.35 < run.changes[1][0] <= 2.45
    assert 5.0 <= run.changes[2][0] <= 5.1


def test_one_glitch_breaks_nothing() -> None:
    run = Run(lambda t: "black" if 2.05 < t < 2.25 else True).go(4)
    assert run.changes == [(0.1, Verdict.OK)]


def test_recovery_starts_anew_at_each_bad_measurement() -> None:
    run = Run(lambda t: True if t < 1 or (t > 2 and round(t * 10) % 8) else "black").go(8)
    assert [verdict for _, verdict in run.changes] == [Verdict.OK, Verdict.BROKEN]


def test_a_late_tick_waits_for_what_is_still_in_the_socket() -> None:
    run = Run(lambda _t: True).go(1)
    late = run.now + NS
    assert run.watch.tick(late) is Verdict.OK
    run.watch.good(late - NS // 20)
    assert run.watch.tick(late + TICK) is Verdict.OK
    run.now = late + TICK
    run.source = lambda _t: None
    assert run.go(1).watch.verdict is Verdict.BROKEN


def test_a_clock_that_jumps_back_starts_anew() -> None:
    run = Run(lambda _t: True).go(1)
    assert run.watch.tick(5 * NS) is Verdict.UNKNOWN
    run.watch.good(5 * NS + TICK)
    assert run.watch.tick(5 * NS + 2 * TICK) is Verdict.OK


def test_reasons_rate_and_age() -> None:
    run = Run(lambda t: True if t < 3 else "cloud is empty: 0 returns").go(2.9)
    assert run.watch.reason == ""
    assert run.watch.rate_hz(run.now) == pytest.approx(10.0, abs=0.1)
    run.go(1.0)
    assert run.watch.reason == "cloud is empty: 0 returns"
    assert run.watch.age_s(run.now) == pytest.approx(1.0, abs=0.05)


@given(st.lists(st.sampled_from([True, None, "bad"]), min_size=1, max_size=80))
@settings(max_examples=60, deadline=None)
def test_never_ok_on_old_and_never_broken_on_fresh_measurements(said) -> None:
    run = Run(lambda t: said[min(round(t * 10) - 1, len(said) - 1)])
    for _ in range(5 * len(said)):
        before = run.watch.verdict
        run.go(0.02)
        age_s = run.watch.age_s(run.now)
        if run.watch.verdict is Verdict.OK:
            assert age_s <= 0.35
        if run.watch.verdict is Verdict.BROKEN and before is not Verdict.BROKEN:
            assert age_s > 0.35
