"""Logs of what the runtime does never alarm; what does not conform is found at its first event and explained."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from prove_models import skillsets
from records_walks import Walk

from alula.model.execution_state import ExecutionState as S
from alula.model.expressions import Comparison, DataIs, ResourceIs
from alula.model.model import (
    Assignment,
    Data,
    Effect,
    Hold,
    Interrupt,
    Invariant,
    Precondition,
    Resource,
    Result,
    Skill,
    Skillset,
    Transition,
)
from alula.records.conformance import Monitor, SkillsetMonitor
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from log_mutations.mutations import MUTATIONS, Spoiler
from log_mutations.witness import legal

QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck)}
SEEDS = st.integers(0, 2**32)
NS = 1_000_000_000

TAKE, GIVE = Effect("take", (Assignment("axes", "USED"),)), Effect("give", (Assignment("axes", "FREE"),))
GOTO = Skill(
    "goto",
    preconditions=(Precondition("free", ResourceIs("axes", "FREE")), Precondition("charged", DataIs("battery", (), Comparison.GT, 0.2))),
    start=TAKE,
    invariants=(
        Invariant("pilot_agrees", ResourceIs("pilot", "AGREES"), GIVE),
        Invariant("link", ResourceIs("radio", "UP"), GIVE, Hold(2.0)),
        Invariant("level", DataIs("battery", (), Comparison.GT, 0.1), GIVE),
    ),
    interrupt=Interrupt(effect=GIVE),
    results=(Result("ARRIVED", effect=GIVE), Result("BLOCKED", effect=GIVE)),
)
ROVER = Skillset(
    "rover",
    data=(Data("battery", "float64"),),
    resources=(
        Resource("axes", ("FREE", "USED"), "FREE", (Transition("FREE", "USED"), Transition("USED", "FREE"))),
        Resource("pilot", ("AGREES", "OBJECTS"), "AGREES", (Transition("AGREES", "OBJECTS", extern=True),)),
        Resource("radio", ("UP", "DOWN"), "UP", (Transition("UP", "DOWN", extern=True), Transition("DOWN", "UP", extern=True))),
    ),
    skills=(GOTO, Skill("watch", results=(Result("DONE"),))),
)


class Story:
    """Writes a log: one event after another, a tenth of a second each."""

    def __init__(self):
        self.events = []

    def _stamp(self):
        return len(self.events) + 1, (len(self.events) + 1) * NS // 10

    def change(self, resource, source, target, cause="extern"):
        self.events.append(TransitionEvent(*self._stamp(), resource, source, target, cause, "rover"))
        return self

    def enter(self, state, result="", execution="1", skill="goto"):
        self.events.append(ExecutionEvent(*self._stamp(), skill, execution, state, result, "", {}, {}, "rover"))
        return self

    def started(self):
        return self.enter(S.REQUESTED).change("axes", "FREE", "USED", "goto 1 take").enter(S.RUNNING)

    def given(self):
        return self.change("axes", "USED", "FREE", "goto 1 give")


def finding(skillset, events):
    monitor = SkillsetMonitor(skillset)
    for event in events:
        if monitor.take(event) is not None:
            return monitor.finding
    return None


@settings(max_examples=25, **QUIET)
@given(skillsets() | skillsets(timed=True), SEEDS)
def test_what_the_runtime_does_conforms(skillset, seed):
    events = Walk(skillset, seed).go(60)
    assert finding(skillset, events) is None
    assume(len(events) > 10)  # enough walks that come to something are looked for


@settings(max_examples=30, **QUIET)
@given(skillsets(), SEEDS, st.sampled_from(sorted(MUTATIONS)))
def test_a_spoiled_log_is_caught_unless_an_engine_really_tells_it(skillset, seed, kind):
    events = Walk(skillset, seed).go(40)
    if {type(event) for event in events} == {ExecutionEvent, TransitionEvent}:
        spoiled = MUTATIONS[kind](Spoiler(skillset, random.Random(seed)), list(events))  # noqa: S311 - nothing here is secret
        assert finding(skillset, spoiled) is not None or legal(skillset, spoiled)


BAD = {
    "it comes after event 1: the log is out of order, or has an event twice": lambda s: s.enter(S.REQUESTED).events * 2,
    "events 2 to 3 are missing": lambda s: [(e := s.started().given().events)[0], e[3]],
    "it is older than the event before, which is of 0.100 s": lambda s: [
        (e := s.enter(S.REQUESTED).enter(S.NOT_VALIDATED).events)[0],
        replace(e[1], stamp_ns=0),
    ],
    "skillset rover has no resource door; it has axes, pilot, radio": lambda s: s.change("door", "A", "B").events,
    "axes was FREE, not USED": lambda s: s.change("axes", "USED", "FREE").events,
    "resource axes: FREE -> USED is for skills only": lambda s: s.change("axes", "FREE", "USED").events,
    "skillset rover has no event nod; it has none": lambda s: s.change("axes", "FREE", "USED", "event nod").events,
    "its cause is no execution that is open: goto 1 take": lambda s: s.change("axes", "FREE", "USED", "goto 1 take").events,
    "skillset rover has no skill fly; it has watch, goto": lambda s: s.enter(S.REQUESTED, skill="fly").events,
    "execution 1 was never requested": lambda s: s.enter(S.RUNNING).events,
    "execution 1 is one of goto": lambda s: s.enter(S.REQUESTED).enter(S.RUNNING, skill="watch").events,
    "execution 1 has ended before, INTERRUPTED": lambda s: s.enter(S.REQUESTED).enter(S.INTERRUPTED).enter(S.RUNNING).events,
    "it was REQUESTED before, from where it can't be PAUSED": lambda s: s.enter(S.REQUESTED).enter(S.PAUSED).events,
    "its precondition free is false": lambda s: s.started().enter(S.REQUESTED, execution="2").enter(S.RUNNING, execution="2").events,
    "goto has no result LOST; it has ARRIVED, BLOCKED": lambda s: s.started().enter(S.TERMINATED, "LOST").events,
    "in the step that this belongs to (goto 1 ends with ARRIVED), axes USED -> FREE (goto 1 give) comes first": (
        lambda s: s.started().enter(S.TERMINATED, "ARRIVED").events
    ),
    "in the step that this belongs to (goto 1 starts), axes FREE -> USED (goto 1 take) comes first": (
        lambda s: s.enter(S.REQUESTED).enter(S.RUNNING).events
    ),
    "it comes within a step (pilot is reported OBJECTS) that goes on with axes USED -> FREE (goto 1 give)": (
        lambda s: s.started().change("pilot", "AGREES", "OBJECTS").enter(S.REQUESTED, execution="2").events
    ),
}


@pytest.mark.parametrize("why", BAD)
def test_what_does_not_conform_is_told_from_its_last_event_on_with_the_reason(why):
    events = BAD[why](Story())
    found = finding(ROVER, events)
    assert found is not None
    assert found.why == why
    assert found.sequence == events[-1].sequence
    assert found.allowed


def test_what_data_and_time_decide_may_go_either_way_but_not_too_early():
    assert finding(ROVER, Story().enter(S.REQUESTED).enter(S.NOT_READY, "charged").events) is None
    broken = Story().started().given().enter(S.RESOURCE_INVARIANT_VIOLATED, "level").events
    assert finding(ROVER, broken) is None
    down = Story().started().change("radio", "UP", "DOWN").given().enter(S.RESOURCE_INVARIANT_VIOLATED, "link").events
    late = [*down[:4], *(replace(event, stamp_ns=event.stamp_ns + 2 * NS) for event in down[4:])]
    assert finding(ROVER, down).event == "goto 1 RESOURCE_INVARIANT_VIOLATED link"
    assert finding(ROVER, late) is None


def test_managers_that_are_restarted_count_from_one_and_know_nothing_of_before():
    first, again = Story().started().events, Story().enter(S.REQUESTED).events
    later = [replace(event, stamp_ns=event.stamp_ns + NS) for event in again]
    monitor = Monitor([ROVER])
    assert [monitor.take(event) for event in (*first, *later)] == [None] * 4
    verdict = monitor.verdict
    assert (verdict.conforms, verdict.restarts, verdict.open) == (True, {"rover": (1.1,)}, ("rover.goto 1",))


def named(events, instance_id):
    return [replace(event, instance_id=instance_id) for event in events]


def test_whose_an_event_is_says_whether_the_managers_were_restarted():
    first, again = Story().started().events, [replace(event, stamp_ns=event.stamp_ns + NS) for event in Story().started().events]
    assert finding(ROVER, [*named(first, "one"), *named(again, "one")]).why.startswith("it comes after event 3: ")
    assert finding(ROVER, [*named(first, "one"), *named(again, "two")]) is None
    lost = finding(ROVER, [*named(first, "one"), *named(again[1:], "two")])
    assert lost.why == "event 1 is missing", "and not: it comes after event 3"
    more = [replace(event, sequence=event.sequence + 3) for event in again[:1]]
    assert finding(ROVER, [*named(first, "one"), *named(more, "two")]).why == "events 1 to 3 are missing", "nor event 4 of the first"


def test_a_log_that_ends_within_a_step_conforms_and_says_what_is_owed():
    monitor = Monitor([ROVER])
    for event in Story().started().given().events:
        assert monitor.take(event) is None
    assert monitor.verdict.conforms
    (owed,) = monitor.verdict.owed
    assert owed.startswith("rover: goto 1 ")
