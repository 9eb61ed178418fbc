"""Random models, random programs in several threads: whatever races, every trace must obey the model."""

from __future__ import annotations

import sys

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from alula_testing.random_models import (
    BEHAVIOURS,
    FOREVER_NS,
    PROGRAMS,
    SKILLS,
    S,
    check_effects,
    check_executions,
    check_hooks,
    check_invariants,
    check_records,
    check_resources,
    give_hooks,
    run_all,
    skillsets,
)
from alula_testing.runtime_models import Bench


@pytest.fixture(autouse=True)
def _eager_switching():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


# Shrinking means little where threads race, and takes minutes.
@settings(max_examples=60, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(skillsets(), st.fixed_dictionaries(dict.fromkeys(SKILLS, BEHAVIOURS)), PROGRAMS)
def test_every_trace_obeys_the_model(skillset, behaviours, programs):
    bench = Bench(skillset, authority=False)
    running: list[tuple[str, str, str]] = []
    give_hooks(bench, behaviours, running)
    run_all(bench, programs)
    assert [event.sequence for event in bench.events] == list(range(1, len(bench.events) + 1))
    check_resources(bench)
    check_executions(bench)
    check_effects(bench)
    check_invariants(bench)
    check_hooks(running)
    bench.now_ns += FOREVER_NS
    bench.engine.tick()
    assert bench.engine.due_ns is None
    assert not [execution for execution in bench.engine.executions if execution.state is S.INTERRUPTING]
    bench.engine.close("over")
    check_executions(bench)
    check_records(bench)
    assert bench.engine.executions == ()
    assert bench.engine._context.entries == {}
