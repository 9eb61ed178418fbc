"""The benchmark's statistics, its table, and the skillsets that it measures."""

from __future__ import annotations

import json
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.model.execution_state import ExecutionState
from alula.runtime.core import SkillsetEngine
from alula.runtime.hooks import SkillHooks
from skill_bench.cases import CASES, FREE, INPUT, LOST, USED, Case, make_skillset, resource_name, skill_name
from skill_bench.figures import (
    HEADINGS,
    Load,
    Measured,
    Times,
    as_json,
    idle_percent,
    join,
    percentile,
    row,
    table,
    times_of,
    verdicts,
)

SAMPLES = st.lists(st.floats(0, 1e6), min_size=1, max_size=50)


def measured(case: str = "10 skills", *, idle: float = 1.0, request: float = 3.0, violation: float = 2.0) -> Measured:
    medians = {"request": request, "goal": 2.0, "violation": violation, "told": 1.0, "topic": 1.0, "interrupt": 4.0, "asked": 5.0}
    times = {name: Times(median, 2 * median, 7) for name, median in medians.items()}
    return Measured(case, 10, 10, times, Load(100.4, idle))


def test_percentiles_of_few_samples():
    assert percentile([7.0], 95) == 7.0
    assert percentile([4.0, 1.0, 3.0, 2.0], 0) == 1.0
    assert percentile([4.0, 1.0, 3.0, 2.0], 100) == 4.0
    assert percentile([0.0, 10.0], 95) == pytest.approx(9.5)
    assert percentile(list(range(101)), 95) == 95


@given(SAMPLES, st.floats(0, 100))
def test_a_percentile_lies_within_and_the_fiftieth_is_the_median(samples, percent):
    assert min(samples) <= percentile(samples, percent) * (1 + 1e-12)
    assert percentile(samples, percent) <= max(samples) * (1 + 1e-12)
    assert percentile(samples, 50) == pytest.approx(statistics.median(samples))


@pytest.mark.parametrize(("samples", "percent"), [([], 50), ([1.0], -1), ([1.0], 101)])
def test_no_percentile_of_nothing_or_beyond(samples, percent):
    with pytest.raises(ValueError, match=f"percentile of {len(samples)} samples"):
        percentile(samples, percent)


def test_blocks_are_joined_by_name_and_counted():
    joined = join([{"request_ms": [1.0], "goal_ms": [5.0]}, {"request_ms": [3.0, 2.0]}])
    assert joined == {"request_ms": [1.0, 3.0, 2.0], "goal_ms": [5.0]}
    assert times_of(joined) == {"request": Times(2.0, pytest.approx(2.9), 3), "goal": Times(5.0, 5.0, 1)}


def test_idle_is_percent_of_one_core():
    assert idle_percent(2.0, 2.03, 6.0) == pytest.approx(0.5)


def test_a_row_has_each_figure_under_its_heading():
    cells = dict(zip(HEADINGS, row(measured()), strict=True))
    assert cells["case"] == "10 skills"
    assert cells["request to RUNNING"] == "3.00 / 6.00"
    assert cells["bare goal accepted"] == "2.00 / 4.00"
    assert cells["extern transition to violation"] == "2.00 / 4.00"
    assert cells["interrupt to INTERRUPTED"] == "4.00 / 8.00"
    assert [cell for heading, cell in zip(HEADINGS, row(measured()), strict=True) if heading == "ratio"] == ["1.50", "2.00"]
    assert (cells["memory MB"], cells["idle CPU %"]) == ("100", "1.0")


def test_the_table_is_markdown():
    lines = table([measured("a"), measured("b")]).splitlines()
    assert len(lines) == 4
    assert {line.count("|") for line in lines} == {len(HEADINGS) + 1}
    assert lines[3].startswith("| b |")


def test_an_aim_is_met_by_the_worst_case_or_missed_by_those_that_miss_it():
    met = verdicts([measured("a"), measured("b", request=2.5)])
    assert [line.rpartition(";")[2] for line in met] == [" met: at most 1.50 (a)", " met: at most 2.00 (a)", " met: at most 1.00 (a)"]
    missed = verdicts([measured("a"), measured("b", request=4.0, violation=3.5, idle=3.2)])
    assert [line.rpartition(";")[2] for line in missed] == [
        " MISSED: 2.00 with b",
        " MISSED: 3.50 with b",
        " MISSED: 3.20 with b",
    ]


def test_the_file_has_every_figure_and_the_aims():
    content = json.loads(json.dumps(as_json([measured()], Load(90.0, 0.1))))
    assert content["aims"] == {"request_ratio": 1.5, "violation_ratio": 3.0, "idle_percent": 3.0}
    assert content["bare"] == {"rss_mb": 90.0, "idle_percent": 0.1}
    case = content["cases"][0]
    assert (case["case"], case["skills"], case["resources"], case["request_ratio"]) == ("10 skills", 10, 10, 1.5)
    assert case["times"]["asked"] == {"p50_ms": 5.0, "p95_ms": 10.0, "number": 7}


def test_the_cases_are_one_ten_a_hundred_of_each():
    assert [case.name for case in CASES] == ["1 skill", "10 skills", "100 skills", "10 resources", "100 resources"]
    assert [(case.skills, case.resources) for case in CASES] == [(1, 1), (10, 10), (100, 100), (1, 10), (1, 100)]


@pytest.mark.parametrize("case", [Case(1, 1), Case(3, 3), Case(1, 5)])
def test_each_skill_of_a_case_runs_and_loses_its_resource(case):
    skillset = make_skillset(case)
    assert (len(skillset.skills), len(skillset.resources)) == (case.skills, case.resources)
    engine = SkillsetEngine(skillset, lambda: 0, {skill.name: SkillHooks() for skill in skillset.skills}, lambda _: None)
    for index in range(case.skills):
        resource = resource_name(index)
        first = engine.request(skill_name(index), {INPUT: 1.0})
        assert (first.state, engine.resources[resource].state) == (ExecutionState.RUNNING, USED)
        engine.interrupt(first.id)
        assert (first.state, engine.resources[resource].state) == (ExecutionState.INTERRUPTED, FREE)
        second = engine.request(skill_name(index), {INPUT: 1.0})
        assert engine.transition(resource, LOST).accepted
        assert (second.state, second.result) == (ExecutionState.RESOURCE_INVARIANT_VIOLATED, "held")
        assert engine.transition(resource, FREE).accepted
