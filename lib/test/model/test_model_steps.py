"""The steps that proofs and conformance count as possible are those that the semantics takes, whatever data and time say."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from model_walks import walk
from prove_models import skillsets, sparse_skillsets

from alula.model import semantics
from alula.model.execution_state import ExecutionState as S
from alula.model.overapproximation import over_approximate
from alula.model.situation import Change, Entered, Running
from alula.model.steps import Cause, PossibleSteps, Stimulus, outcomes_of, take

pytestmark = pytest.mark.long
QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck)}
SEEDS = st.integers(0, 2**32)
MODELS = skillsets() | skillsets(timed=True) | sparse_skillsets()
CAUSES = {"terminate": Cause.RESULT, "interrupt": Cause.INTERRUPT, "fail": Cause.FAIL, "lose": Cause.BREAK}


def situations(skillset, seed):
    """Return where a walk comes to, without data and time, and its steps from there."""
    walked = [
        (replace(semantics.initial(skillset), states=one.before.states, running=one.before.running), one)
        for one in walk(skillset, seed, 20)
    ]
    return PossibleSteps(over_approximate(skillset)), walked


def outline(step):
    """Return what happens in a step, without the words."""
    return [one if isinstance(one, Change) else (one.execution, one.state, one.result, one.effect_failed) for one in step.happenings]


@settings(max_examples=80, **QUIET)
@given(MODELS, SEEDS)
def test_the_functional_layer_and_events_can_do_what_is_not_refused(skillset, seed):
    steps, walked = situations(skillset, seed)
    for situation, _ in walked:
        outside = [one for one in steps.of(situation) if one.cause in {Cause.EXTERN, Cause.EVENT}]
        externs = [Stimulus(Cause.EXTERN, r.name, to) for r in skillset.resources for to in r.states]
        externs = [one for one in externs if not semantics.extern_refusal(skillset, situation, one.name, one.target)]
        events = [Stimulus(Cause.EVENT, one.name) for one in skillset.events]
        events = [one for one in events if not semantics.event_refusal(skillset, situation, one.name)]
        assert sorted(map(str, outside)) == sorted(map(str, [*externs, *events]))


@settings(max_examples=80, **QUIET)
@given(MODELS, SEEDS)
def test_every_step_that_is_taken_begins_as_a_possible_one_does(skillset, seed):
    """What data and time break besides follows as steps of their own, so the beginning is compared."""
    steps, walked = situations(skillset, seed)
    for situation, taken in walked:
        requested = [taken.execution] if taken.act == "start" else []
        possible = [outline(take(steps.skillset, situation, one)) for one in steps.of(situation, requested)]
        happened = outline(taken.step)
        if taken.act in {"time", "value"} and happened:
            first = next(one for one in taken.entered if one.state.terminal)
            breaks = [one for one in steps.of_running(situation, first.execution) if one.cause is Cause.BREAK]
            assert first.state is S.FAILED or first.result in {one.name for one in breaks}
        elif happened and taken.act != "lose":  # which walks do to invariants of any kind
            stem = beginning(taken, happened)
            assert any(one[: len(stem)] == stem for one in possible), (taken.act, stem)


def beginning(taken, happened):
    """Return what the step itself does, without what is broken by it."""
    own = [one for one in happened if isinstance(one, Change) and one.cause == happened[0].cause] if isinstance(happened[0], Change) else []
    entered = [one for one in happened if not isinstance(one, Change) and one[0] == taken.execution]
    return [*own, *entered[:1]]


@settings(max_examples=80, **QUIET)
@given(MODELS, SEEDS)
def test_each_possible_step_is_about_what_asked_for_it(skillset, seed):
    """A request is answered, an execution that runs ends once, a transition is taken; refusals and phases leave the resources alone."""
    steps, walked = situations(skillset, seed)
    for situation, _ in walked:
        requested = [Running("new", skill.name) for skill in skillset.skills]
        for stimulus in steps.of(situation, requested):
            step = take(steps.skillset, situation, stimulus)
            about = [one for one in step.happenings if isinstance(one, Entered) and one.execution == stimulus.execution]
            if stimulus.cause is Cause.EXTERN:
                source = situation.states[stimulus.name]
                assert step.happenings[0] == Change(stimulus.name, source, stimulus.target, semantics.EXTERN)
            elif stimulus.cause is Cause.DIE:
                assert step.situation == semantics.initial(skillset)
                assert [one.execution for one in step.happenings] == list(situation.running)
            elif stimulus.cause is not Cause.EVENT:
                assert sum(one.state.terminal for one in about) == (1 if stimulus.cause is not Cause.START else len(about) - started(about))
                assert (stimulus.execution in step.situation.running) <= (stimulus.cause is Cause.START)
            if stimulus.execution in requested and stimulus.cause is not Cause.START:
                assert step.situation == situation


def started(entered):
    return sum(one.state is S.RUNNING for one in entered)


@settings(max_examples=80, **QUIET)
@given(MODELS, SEEDS)
def test_a_request_is_always_answered_and_a_running_execution_can_always_end(skillset, seed):
    steps, walked = situations(skillset, seed)
    for situation, _ in walked:
        for skill in skillset.skills:
            causes = [one.cause for one in steps.of_request(situation, Running("new", skill.name))]
            assert {Cause.REJECT, Cause.INTERRUPT, Cause.FAIL} < set(causes)
            assert Cause.START in causes or Cause.REFUSE in causes
        for execution in situation.running:
            names = [(one.cause, one.name) for one in steps.of_running(situation, execution)]
            asked = [(end.cause, end.name) for end in outcomes_of(skillset.skill(execution.skill))]
            assert names[: len(asked)] == asked
            assert len(names) == len(set(names))
