"""What is drawn for a campaign, for any file: within its ranges, the same for the same seed, each thing at most once a run."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.campaign.drawing import Draw, Kind
from alula.common.faults import parse_fault

SCENARIOS = ("inspection", "mapping")
SEEDS = st.integers(0, 2**31 - 1)
SPANS = st.tuples(st.integers(0, 600), st.integers(0, 600)).map(lambda two: (min(two) / 10, max(two) / 10))


@st.composite
def draws(draw: st.DrawFn) -> Draw:
    """Any draw that a file can ask for: each thing is in one entry of a scenario."""
    faults = {}
    for scenario in SCENARIOS:
        things = draw(st.lists(st.sampled_from("abcdef"), min_size=1, max_size=6, unique=True))
        ways = st.lists(st.builds(Kind, st.just(""), st.sampled_from("xyz"), st.none() | st.integers(1, 20)), min_size=1, max_size=4)
        faults[scenario] = [[replace(kind, what=thing) for kind in draw(ways)] for thing in things]
    most = draw(st.integers(0, min(map(len, faults.values()))))
    lasts_s = draw(st.none() | SPANS.filter(lambda span: span[0] > 0.1))
    return Draw(faults, {}, least=draw(st.integers(0, most)), most=most, at_s=draw(SPANS), lasts_s=lasts_s)


@given(draws(), SEEDS, st.integers(1, 30))
def test_the_same_seed_draws_the_same_and_more_runs_change_none(draw: Draw, seed: int, count: int) -> None:
    runs = list(draw.runs(SCENARIOS, count, seed))
    assert runs == list(draw.runs(SCENARIOS, count, seed))
    assert runs == list(draw.runs(SCENARIOS, count + 7, seed))[:count]


@given(draws(), SEEDS)
def test_what_is_drawn_is_within_what_the_file_says(draw: Draw, seed: int) -> None:
    for run in draw.runs(SCENARIOS, 20, seed):
        assert draw.least <= len(run.faults) <= draw.most
        assert len({fault.what for fault in run.faults}) == len(run.faults), "no thing fails twice in a run"
        assert 0 <= run.seed < 2**31
        for fault in run.faults:
            kinds = [kind for entry in draw.faults[run.scenario] for kind in entry if (kind.what, kind.how) == (fault.what, fault.how)]
            assert kinds
            assert draw.at_s[0] - 0.05 <= fault.begin_s <= draw.at_s[1] + 0.05
            if fault.end_s is not None:
                own = {kind.lasts_s for kind in kinds}
                low, high = draw.lasts_s or (0.0, 0.0)
                lasts_s = fault.end_s - fault.begin_s
                assert round(lasts_s, 6) in own or (None in own and low - 0.11 <= lasts_s <= high + 0.11)
            assert parse_fault(str(fault)) == fault, "a row's text is the fault"
        assert [fault.begin_s for fault in run.faults] == sorted(fault.begin_s for fault in run.faults)


def test_each_entry_and_each_of_its_kinds_has_the_same_chance() -> None:
    entries = [[Kind("zed", how) for how in ("dead", "dark", "late")], [Kind("lidar", "dead")], [Kind("gps", "dead")]]
    draw = Draw({"mapping": entries}, {}, least=1, most=1, at_s=(0.0, 9.0), lasts_s=None)
    drawn = Counter(fault.what for run in draw.runs(["mapping"], 3000, 1) for fault in run.faults)
    ways = Counter(fault.how for run in draw.runs(["mapping"], 3000, 1) for fault in run.faults if fault.what == "zed")
    # 3000 draws of a chance of a third: four standard deviations are 103.
    assert all(times == pytest.approx(1000, abs=103) for times in drawn.values())
    assert all(times == pytest.approx(drawn["zed"] / 3, abs=60) for times in ways.values())


def test_runs_have_seeds_of_their_own() -> None:
    draw = Draw({"mapping": [[Kind("zed", "")]]}, {}, least=0, most=1, at_s=(0.0, 9.0), lasts_s=None)
    assert len({run.seed for run in draw.runs(["mapping"], 1000, 3)}) > 990
