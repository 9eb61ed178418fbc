"""Events to executions and transitions: every form of an event, cut files, and any interleaving."""

from __future__ import annotations

import contextlib
import json
import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.common.record import EVENTS, FILE, MISSION, RecordError, RecordWriter
from alula.model.execution_state import ExecutionState
from alula.records.causes.alarms import Alarms
from alula.report.files import Problems
from alula.report.history import fold, gaps, in_order, read_history
from alula.report.phases import Phases
from alula.report.timeline import make_timeline
from alula.runtime.core.events import TransitionEvent, event_record, read_event

sys.path.insert(0, str(Path(__file__).parent))
from alula_testing.run_log import LIFT_OFF_S, Log, failing_flight

TERMINAL_STATES = {state.value for state in ExecutionState if state.terminal}


def record(**values) -> dict:
    return {"stamp_s": 3.5, "sequence": 2, "skillset": "navigation", **values}


def started(**values) -> dict:
    return record(kind="EXECUTION", **{"skill": "goto", "id": "g1", "state": "RUNNING", **values})


def test_a_record_is_one_of_an_event():
    event = read_event(started(skill="takeoff", id="t1", inputs={"height": 3.0}))
    assert (event.stamp_s, event.sequence, event.skillset) == (3.5, 2, "navigation")
    assert (event.skill, event.id, event.state, event.inputs) == ("takeoff", "t1", ExecutionState.RUNNING, {"height": 3.0})
    event = read_event(record(kind="TRANSITION", resource="zed_status", cause="extern", from_state="OK", to_state="BROKEN"))
    assert event == TransitionEvent(2, 3_500_000_000, "zed_status", "OK", "BROKEN", "extern", "navigation")
    assert json.loads(json.dumps(event_record(event))) == {
        **record(kind="TRANSITION", resource="zed_status", cause="extern"),
        "from_state": "OK",
        "to_state": "BROKEN",
        "reason": "",
        "instance_id": "",
    }
    because = replace(event, reason="the lens is covered")
    assert read_event(json.loads(json.dumps(event_record(because)))) == because


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"stamp_s": "soon"},
        started(stamp_s="soon"),
        started(stamp_s=math.nan),
        started(stamp_s=math.inf),
        started(state="FLYING"),
        started(sequence=None),
        record(skill="goto", id="g1", state="RUNNING"),
        record(kind="EXECUTION", skill="goto", id="g1"),
        record(kind="TRANSITION", resource="zed_status", from_state="OK"),
        record(kind=7, skill="goto", id="g1", state="RUNNING"),
    ],
)
def test_no_event(values):
    with pytest.raises(ValueError, match=r"."):
        read_event(values)


def test_an_execution_from_request_to_end():
    log = Log()
    log.skill(1.0, "navigation.goto", "g1", "REQUESTED", inputs={"speed": 1.0})
    log.skill(1.25, "navigation.goto", "g1", "RUNNING")
    log.skill(7.5, "navigation.goto", "g1", "TERMINATED", result="ARRIVED", message="0.1 m off")
    history = fold([read_event(event) for event in log.events], Problems())
    (goto,) = history.executions
    assert (goto.requested_s, goto.started_s, goto.ended_s) == (LIFT_OFF_S + 1.0, LIFT_OFF_S + 1.25, LIFT_OFF_S + 7.5)
    assert (goto.state.value, goto.result, goto.message, goto.inputs) == ("TERMINATED", "ARRIVED", "0.1 m off", {"speed": 1.0})
    assert (history.first_s, history.last_s) == (LIFT_OFF_S + 1.0, LIFT_OFF_S + 7.5)


def test_the_first_end_counts_and_a_second_is_a_problem():
    problems = Problems()
    states = ["REQUESTED", "RUNNING", "INTERRUPTED", "TERMINATED"]
    events = [read_event(started(sequence=n + 1, stamp_s=float(n), skill="goto", id="g1", state=state)) for n, state in enumerate(states)]
    (goto,) = fold(events, problems).executions
    assert (goto.state.value, goto.ended_s) == ("INTERRUPTED", 2.0)
    assert problems.sentences == ["navigation.goto g1: TERMINATED after its end as INTERRUPTED"]


def test_latched_repetitions_count_once_and_gaps_are_told():
    def at(number, stamp_s):
        return read_event(started(sequence=number, stamp_s=stamp_s, skill="goto", id=str(number), state="REQUESTED"))

    events = in_order([at(2, 2.0), at(1, 1.0), at(2, 2.0), at(5, 3.0), at(1, 9.0), at(2, 10.0)])
    assert [event.sequence for event in events] == [1, 2, 5, 1, 2]
    assert list(gaps(events)) == ["navigation lost 2 events before 3.00 s of mission clock"]


def test_what_other_managers_lost_first_is_told_by_whose_the_events_are():
    def at(number, stamp_s, whose):
        values = started(sequence=number, stamp_s=stamp_s, instance_id=whose, skill="goto", id=str(number), state="REQUESTED")
        return read_event(values)

    events = [at(1, 1.0, "a"), at(2, 2.0, "a"), at(3, 9.0, "b"), at(4, 10.0, "b")]
    assert list(gaps(events)) == ["navigation lost 2 events before 9.00 s of mission clock"]
    assert list(gaps([*events[:2], at(1, 9.0, "b")])) == []


def test_what_a_mission_has_left_out_because_it_was_before_it_is_not_lost(tmp_path):
    writer = RecordWriter(tmp_path / FILE)
    writer.write(EVENTS, 5_000_000_000, started(sequence=41, stamp_s=5.0, skill="goto", id="g", state="REQUESTED"))
    writer.write(MISSION, 6_000_000_000, {"outcome": "accomplished", "joined": {"navigation": 40}})
    writer.close()
    problems = Problems()
    history = read_history(tmp_path / FILE, problems)
    assert ([event.sequence for event in history.events], problems.sentences) == ([41], [])
    assert list(gaps(history.events, {"navigation": 39})) == ["navigation lost 1 events before 5.00 s of mission clock"]


def test_missing_file_is_a_problem(tmp_path):
    problems = Problems()
    assert read_history(tmp_path / FILE, problems).events == ()
    assert problems.sentences == ["skills.mcap is missing: nothing is known of skills and resources"]


def test_a_bad_event_costs_only_itself(tmp_path):
    writer = RecordWriter(tmp_path / FILE)
    for values in ({"stamp_s": "soon"}, started(sequence=1, id="1")):
        writer.write(EVENTS, 0, values)
    writer.close()
    problems = Problems()
    assert [event.sequence for event in read_history(tmp_path / FILE, problems).events] == [1]
    assert len(problems.sentences) == 1
    assert problems.sentences[0].startswith("skills.mcap: event 1 is no event")


def test_what_stands_before_a_cut_is_read_and_the_cut_is_told(tmp_path):
    path = tmp_path / FILE
    failing_flight().write(path)
    whole = path.read_bytes()
    expected = read_history(path, Problems()).events
    for part in (0.25, 0.5, 0.9):
        path.write_bytes(whole[: int(part * len(whole))])
        problems = Problems()
        events = read_history(path, problems).events
        assert 0 < len(events) < len(expected)
        assert events == expected[: len(events)]
        (told,) = problems.sentences
        assert re.fullmatch(r"skills\.mcap: it was cut off at byte \d+", told)


@given(content=st.binary(max_size=300))
def test_no_content_is_too_bad(content, tmp_path_factory):
    path = tmp_path_factory.mktemp("bad") / FILE
    path.write_bytes(content)
    with contextlib.suppress(RecordError):
        read_history(path, Problems())


@st.composite
def lives(draw):
    """Draw executions, each with the states that it goes through, and an interleaving of them all."""
    endings = st.sampled_from(sorted(TERMINAL_STATES))
    life = st.one_of(
        st.just(["REQUESTED"]),
        st.just(["REQUESTED", "RUNNING"]),
        endings.map(lambda end: ["REQUESTED", end] if end in {"NOT_VALIDATED", "NOT_READY"} else ["REQUESTED", "RUNNING", end]),
    )
    chosen = draw(st.lists(life, max_size=8))
    turns = draw(st.permutations([k for k, states in enumerate(chosen) for _ in states]))
    return chosen, turns


@given(lives())
def test_any_interleaving_folds_to_the_same_executions(drawn):
    chosen, turns = drawn
    left = [list(states) for states in chosen]
    stamps: list[dict[str, float]] = [{} for _ in chosen]
    events = []
    for step, k in enumerate(turns):
        state = left[k].pop(0)
        stamps[k][state] = float(step)
        events.append(read_event(started(sequence=step + 1, stamp_s=float(step), skill=f"skill{k % 3}", id=str(k), state=state)))
    problems = Problems()
    history = fold(in_order(reversed(events)), problems)
    assert problems.sentences == []
    assert len(history.executions) == len(chosen)
    for execution in history.executions:
        k = int(execution.id)
        assert execution.state.value == chosen[k][-1]
        assert execution.requested_s == stamps[k]["REQUESTED"]
        assert execution.started_s == stamps[k].get("RUNNING")
        assert execution.ended_s == (stamps[k][chosen[k][-1]] if chosen[k][-1] in TERMINAL_STATES else None)
    assert [e.requested_s for e in history.executions] == sorted(e.requested_s for e in history.executions)


@pytest.mark.parametrize("name", ["UNLOCKED", "BLOCKING", "UNBLOCKED", "FAILSAFE_OFF", "ABORTED", "ARRIVED"])
@pytest.mark.parametrize(("kind", "shown"), [("success", "success"), ("failure", "failure"), ("result", "ended"), ("", "ended")])
def test_the_timeline_shows_how_an_execution_ended_as_its_event_says_it(name, kind, shown):
    events = [started(), started(sequence=3, state="TERMINATED", result=name, result_kind=kind)]
    phases = Phases()
    timeline = make_timeline(fold([read_event(event) for event in events], Problems()), phases, None, Alarms())
    assert [(bar["result"], bar["ending"]) for row in timeline["skills"] for bar in row["bars"]] == [(name, shown)]


def test_the_timeline_shows_a_state_as_bad_by_the_models_and_not_by_its_name():
    phases, log = Phases(), [("zed_status", "OK", "BROKEN"), ("zed_status", "BROKEN", "DIM"), ("zed_status", "DIM", "OK")]
    changes = [TransitionEvent(at, at * 10**9, *change, "extern", "perception") for at, change in enumerate(log, start=1)]
    alarms = Alarms(always=frozenset({"perception.zed_status DIM"}), away=frozenset({"perception.zed_status OK"}))
    (row,) = make_timeline(fold(changes, Problems()), phases, None, alarms)["resources"]
    assert [(band["state"], band["alarm"]) for band in row["bands"]] == [("OK", False), ("BROKEN", False), ("DIM", True), ("OK", False)]
