"""The laws of the execution semantics (skillsets/LANGUAGE.md, Meaning), each held over random steps of random models."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from model_walks import walk
from prove_models import skillsets, sparse_skillsets

from alula.model import semantics
from alula.model.conditions import judge
from alula.model.deadlines import due_ns, waits
from alula.model.effects import after, effect_changes
from alula.model.errors import EffectError
from alula.model.execution_state import ExecutionState as S
from alula.model.situation import Entered, Situation
from alula.model.transitions import may_go

pytestmark = pytest.mark.long
QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck)}
SEEDS = st.integers(0, 2**32)
MODELS = skillsets() | skillsets(timed=True) | sparse_skillsets()


def remembered(situation: Situation) -> tuple[object, ...]:
    return dict(situation.states), situation.running, situation.now_ns, dict(situation.data), situation.fallen


def what_changes_is_told(skillset, taken):
    """The states after a step are those before it with its changes, one after another; a state that stays is no change of a skill."""
    states = dict(taken.before.states)
    for change in taken.changes:
        assert states[change.resource] == change.source
        assert change.source != change.target or change.cause == semantics.EXTERN
        states[change.resource] = change.target
    assert states == dict(taken.step.situation.states)


def only_transitions_are_taken(skillset, taken):
    """The functional layer takes extern transitions, skills take the others, events any."""
    for change in taken.changes:
        resource = skillset.resource(change.resource)
        if change.cause == semantics.EXTERN:
            assert resource.has_transition(change.source, change.target, extern=True)
        else:
            assert may_go(resource, change.source, change.target, any_transition=change.cause.startswith("event "))


def an_execution_ends_once(skillset, taken):
    """What ran and runs no more has entered one terminal state; what runs on has entered none; nothing else ends."""
    ends = [one.execution for one in taken.entered if one.state.terminal]
    assert len(ends) == len(set(ends))
    gone = set(taken.before.running) - set(taken.step.situation.running)
    new = {taken.execution} if taken.act == "start" else set()
    assert gone <= set(ends) <= gone | new
    assert set(taken.step.situation.running) <= set(taken.before.running) | new


def a_refused_start_changes_nothing(skillset, taken):
    """It names the precondition that is false, or its effect is no transition."""
    if taken.act == "start" and taken.entered[0].state is S.NOT_READY:
        assert taken.step.situation == taken.before
        assert len(taken.step.happenings) == 1
        skill = skillset.skill(taken.execution.skill)
        false = [one.name for one in skill.preconditions if judge(one.condition, taken.before.states, taken.before.data) is not True]
        assert taken.entered[0].result == (false[0] if false else "")


def a_start_is_at_once(skillset, taken):
    """All of its effect is taken with RUNNING, and only then is anything broken."""
    if taken.act == "start" and taken.entered[0].state is S.RUNNING:
        skill = skillset.skill(taken.execution.skill)
        changes = effect_changes(skillset, taken.execution, skill.start, "start", taken.before.states)
        assert taken.step.happenings[: len(changes) + 1] == (*changes, taken.entered[0])


def nothing_broken_runs_on(skillset, taken):
    """At the end of a step every running execution's invariants are true, but for those that may be false for a while yet."""
    situation = taken.step.situation
    for execution in situation.running:
        skill = skillset.skill(execution.skill)
        for invariant in skill.invariants:
            if not waits(invariant) and (skill.name, invariant.name) not in situation.fallen:
                assert judge(invariant.condition, situation.states, situation.data) is not False


def what_is_broken_says_by_what(skillset, taken):
    """A violation names an invariant of its skill; its effect is applied whole, right before it, or, told so, not at all."""
    states, since = dict(taken.before.states), []
    for happening in taken.step.happenings:
        if isinstance(happening, Entered) and happening.state is S.RESOURCE_INVARIANT_VIOLATED:
            skill = skillset.skill(happening.execution.skill)
            invariant = next(one for one in skill.invariants if one.name == happening.result)
            mine = f"{skill.name} {happening.execution.id} {invariant.effect.name or invariant.name}"
            own = tuple(one for one in since if one.cause == mine)
            first = after(states, tuple(one for one in since if one.cause != mine))
            assert happening.effect_failed == (not possible(skillset, happening.execution, invariant.effect, first))
            expected = (
                () if happening.effect_failed else effect_changes(skillset, happening.execution, invariant.effect, invariant.name, first)
            )
            assert own == expected
        if isinstance(happening, Entered):
            states, since = after(states, tuple(since)), []
        else:
            since.append(happening)


def a_failure_gives_back_what_an_interruption_does(skillset, taken):
    """Where the interruption's effect is possible; else nothing is changed by it."""
    if taken.act == "fail":
        skill = skillset.skill(taken.execution.skill)
        stopped = semantics.interrupt(skillset, taken.before, taken.execution)
        assert taken.entered[0] == Entered(taken.execution, S.FAILED, "", "asked to")
        if possible(skillset, taken.execution, skill.interrupt.effect, taken.before.states):
            assert dict(stopped.situation.states) == dict(taken.step.situation.states)
            assert stopped.situation.running == taken.step.situation.running


def an_end_is_the_one_that_was_asked_for_or_a_failure(skillset, taken):
    """It is FAILED where the skill has no such result, its effect is no transition, or its postcondition is false after it."""
    if taken.act in {"terminate", "interrupt"}:
        skill, entered = skillset.skill(taken.execution.skill), taken.entered[0]
        result = next((one for one in skill.results if one.name == taken.name), None) if taken.act == "terminate" else skill.interrupt
        fits = result is not None and possible(skillset, taken.execution, result.effect, taken.before.states)
        if fits:
            states = after(taken.before.states, effect_changes(skillset, taken.execution, result.effect, "", taken.before.states))
            fits = judge(result.postcondition, states, taken.before.data) is True
        asked = S.TERMINATED if taken.act == "terminate" else S.INTERRUPTED
        assert (entered.execution, entered.state) == (taken.execution, asked if fits else S.FAILED)


def a_step_leaves_nothing_to_do(skillset, taken):
    """At the same time, with the same values, nothing more happens."""
    again = semantics.elapse(skillset, taken.step.situation)
    assert not again.happenings
    assert remembered(again.situation) == remembered(taken.step.situation)


def time_breaks_what_is_due_and_nothing_before(skillset, taken):
    """``due_ns`` is the moment at which time alone ends something, and no earlier one is."""
    situation = taken.step.situation
    due = due_ns(skillset, situation)
    if due is None:
        later = semantics.elapse(skillset, replace(situation, now_ns=situation.now_ns + 10**12))
        assert not later.happenings
    elif due > situation.now_ns:
        assert not semantics.elapse(skillset, replace(situation, now_ns=due - 1)).happenings
        assert semantics.elapse(skillset, replace(situation, now_ns=due)).happenings


def nothing_is_remembered_of_what_has_ended(skillset, taken):
    """Clocks belong to executions that run."""
    situation = taken.step.situation
    assert {execution for execution, _ in situation.false_since} <= set(situation.running)
    assert set(situation.progressed) <= {one.id for one in situation.running}


def possible(skillset, execution, effect, states):
    try:
        effect_changes(skillset, execution, effect, "", states)
    except EffectError:
        return False
    return True


LAWS = (
    what_changes_is_told,
    only_transitions_are_taken,
    an_execution_ends_once,
    a_refused_start_changes_nothing,
    a_start_is_at_once,
    nothing_broken_runs_on,
    what_is_broken_says_by_what,
    a_failure_gives_back_what_an_interruption_does,
    an_end_is_the_one_that_was_asked_for_or_a_failure,
    a_step_leaves_nothing_to_do,
    time_breaks_what_is_due_and_nothing_before,
    nothing_is_remembered_of_what_has_ended,
)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__)
@settings(max_examples=60, **QUIET)
@given(skillset=MODELS, seed=SEEDS)
def test_the_semantics_keeps_its_laws(law, skillset, seed):
    for taken in walk(skillset, seed, 30):
        law(skillset, taken)
