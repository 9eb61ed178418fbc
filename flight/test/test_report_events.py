"""Events to executions and transitions: every form of a line, cut files, and any interleaving."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula_flight.report.events import fold, gaps, in_order, parse_event, read_events
from alula_flight.report.files import Problems, ReportError
from skill_model.execution_state import ExecutionState
from skill_runtime.core.events import TransitionEvent, event_record

sys.path.insert(0, str(Path(__file__).parent))
from test_report_sample import LIFT_OFF_S, Log, failing_flight

TERMINAL_STATES = {state.value for state in ExecutionState if state.terminal}


def line(**values) -> str:
    return json.dumps({"stamp_s": 3.5, "sequence": 2, "skillset": "navigation", **values})


def started(**values) -> str:
    return line(kind="EXECUTION", **{"skill": "goto", "id": "g1", "state": "RUNNING", **values})


def test_a_line_is_the_record_of_an_event():
    event = parse_event(started(skill="takeoff", id="t1", inputs={"height": 3.0}))
    assert (event.stamp_s, event.sequence, event.skillset) == (3.5, 2, "navigation")
    assert (event.skill, event.id, event.state, event.inputs) == ("takeoff", "t1", ExecutionState.RUNNING, {"height": 3.0})
    event = parse_event(line(kind="TRANSITION", resource="zed_status", cause="extern", from_state="OK", to_state="BROKEN"))
    assert event == TransitionEvent(2, 3_500_000_000, "zed_status", "OK", "BROKEN", "extern", "navigation")
    assert json.loads(json.dumps(event_record(event))) == {
        **json.loads(line(kind="TRANSITION", resource="zed_status", cause="extern")),
        "from_state": "OK",
        "to_state": "BROKEN",
    }


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "null",
        '{"stamp_s": "soon"}',
        started(stamp_s="soon"),
        started(stamp_s=math.nan),
        started(stamp_s=math.inf),
        started(state="FLYING"),
        started(sequence=None),
        line(skill="goto", id="g1", state="RUNNING"),
        line(kind="EXECUTION", skill="goto", id="g1"),
        line(kind="TRANSITION", resource="zed_status", from_state="OK"),
        line(kind=7, skill="goto", id="g1", state="RUNNING"),
    ],
)
def test_no_event(text):
    with pytest.raises(ReportError):
        parse_event(text)


def test_an_execution_from_request_to_end():
    log = Log()
    log.skill(1.0, "navigation.goto", "g1", "REQUESTED", inputs={"speed": 1.0})
    log.skill(1.25, "navigation.goto", "g1", "RUNNING")
    log.skill(7.5, "navigation.goto", "g1", "TERMINATED", result="ARRIVED", message="0.1 m off")
    history = fold([parse_event(json.dumps(event)) for event in log.events], Problems())
    (goto,) = history.executions
    assert (goto.start_s, goto.running_s, goto.end_s) == (LIFT_OFF_S + 1.0, LIFT_OFF_S + 1.25, LIFT_OFF_S + 7.5)
    assert (goto.outcome, goto.result, goto.message, goto.inputs) == ("TERMINATED", "ARRIVED", "0.1 m off", {"speed": 1.0})
    assert (history.first_s, history.last_s) == (LIFT_OFF_S + 1.0, LIFT_OFF_S + 7.5)


def test_the_first_end_counts_and_a_second_is_a_problem():
    problems = Problems()
    states = ["REQUESTED", "RUNNING", "INTERRUPTED", "TERMINATED"]
    events = [parse_event(started(sequence=n + 1, stamp_s=float(n), skill="goto", id="g1", state=state)) for n, state in enumerate(states)]
    (goto,) = fold(events, problems).executions
    assert (goto.outcome, goto.end_s) == ("INTERRUPTED", 2.0)
    assert problems.sentences == ["navigation.goto g1: TERMINATED after its end as INTERRUPTED"]


def test_latched_repetitions_count_once_and_gaps_are_told():
    def at(number, stamp_s):
        return parse_event(started(sequence=number, stamp_s=stamp_s, skill="goto", id=str(number), state="REQUESTED"))

    events = in_order([at(2, 2.0), at(1, 1.0), at(2, 2.0), at(5, 3.0), at(1, 9.0), at(2, 10.0)])
    assert [event.sequence for event in events] == [1, 2, 5, 1, 2]
    assert list(gaps(events)) == ["navigation lost 2 events before 3.00 s of mission clock"]


def test_missing_file_is_a_problem(tmp_path):
    problems = Problems()
    assert read_events(tmp_path / "events.jsonl", problems) == []
    assert problems.sentences == ["events.jsonl is missing: nothing is known of skills and resources"]


def test_a_bad_line_costs_only_itself(tmp_path):
    path = tmp_path / "events.jsonl"
    path.write_bytes(b"\xff\xfe\n" + started(sequence=1, id="1").encode() + b"\n\n")
    problems = Problems()
    assert [event.sequence for event in read_events(path, problems)] == [1]
    assert len(problems.sentences) == 1
    assert problems.sentences[0].startswith("events.jsonl: line 1 is no event")


@given(cut=st.integers(min_value=0))
def test_a_file_cut_anywhere_gives_what_stands_before_the_cut(cut, tmp_path_factory):
    path = tmp_path_factory.mktemp("cut") / "events.jsonl"
    failing_flight().write(path)
    whole = path.read_bytes()
    kept = whole[: cut % (len(whole) + 1)]
    path.write_bytes(kept)
    problems = Problems()
    events = read_events(path, problems)
    # The last byte of a line may be its newline: without it the event is whole all the same.
    complete = kept.count(b"\n") + (
        1 if not kept.endswith(b"\n") and kept.endswith(b"}") and whole[len(kept) : len(kept) + 1] == b"\n" else 0
    )
    assert len(events) == complete
    cut_off = [sentence for sentence in problems.sentences if "was cut off" in sentence]
    assert len(cut_off) == (0 if not kept or kept.endswith(b"\n") or complete > kept.count(b"\n") else 1)
    fold(events, problems)


@given(text=st.text(max_size=300))
def test_no_text_is_too_bad(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("bad") / "events.jsonl"
    path.write_text(text, encoding="utf-8", errors="replace")
    fold(read_events(path, Problems()), Problems())


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
        events.append(parse_event(started(sequence=step + 1, stamp_s=float(step), skill=f"skill{k % 3}", id=str(k), state=state)))
    problems = Problems()
    history = fold(in_order(reversed(events)), problems)
    assert problems.sentences == []
    assert len(history.executions) == len(chosen)
    for execution in history.executions:
        k = int(execution.id)
        assert execution.outcome == chosen[k][-1]
        assert execution.start_s == stamps[k]["REQUESTED"]
        assert execution.running_s == stamps[k].get("RUNNING")
        assert execution.end_s == (stamps[k][chosen[k][-1]] if chosen[k][-1] in TERMINAL_STATES else None)
    assert [e.start_s for e in history.executions] == sorted(e.start_s for e in history.executions)
