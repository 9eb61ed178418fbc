"""Faults: one grammar, every error with what would be right."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula.common.faults import MENDED, FaultError, FaultRequest, changes_of, parse_fault, parse_faults, spans_of

KNOWN = {"zed": ("dead", "dark"), "radio": ("critical",)}
WORDS = st.text("abz09_", min_size=1, max_size=8)
SECONDS = st.integers(0, 10**9).map(lambda n: n / 1000)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("zed", FaultRequest("zed")),
        ("zed@30", FaultRequest("zed", "", 30.0)),
        (" zed:dark@30.5 ", FaultRequest("zed", "dark", 30.5)),
        ("zed:dark", FaultRequest("zed", "dark")),
        ("radio@40-55", FaultRequest("radio", "", 40.0, 55.0)),
        ("zed:dark@0-0.5", FaultRequest("zed", "dark", 0.0, 0.5)),
    ],
)
def test_a_fault_is_read(text, fault):
    assert parse_fault(text, KNOWN) == fault


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "write WHAT"),
        ("zed@", "write WHAT"),
        ("zed@-3", "write WHAT"),
        ("zed@3-", "write WHAT"),
        ("zed@nan", "write WHAT"),
        ("zed:@3", "write WHAT"),
        ("zed dark", "write WHAT"),
        ("zed@٣", "write WHAT"),
        ("zed@40-30", "ends at 30 s, but begins at 40 s"),
        ("zed@3-3", "ends at 3 s, but begins at 3 s"),
        ("zed@99999999", "more than"),
        ("zad@3", "no 'zad' to break; choose one of zed, radio (did you mean `zed`?)"),
        ("zed:drak@3", "zed can't be 'drak'; choose one of dead, dark (did you mean `dark`?)"),
    ],
)
def test_what_is_no_fault_is_refused_with_the_remedy(text, said):
    with pytest.raises(FaultError) as caught:
        parse_fault(text, KNOWN)
    assert f"fault '{text}'" in str(caught.value)
    assert said in str(caught.value)


def test_several_stand_between_commas():
    assert parse_faults("zed@30, radio:critical@40-55,,") == [FaultRequest("zed", "", 30.0), FaultRequest("radio", "critical", 40.0, 55.0)]
    assert parse_faults("") == []


@given(WORDS, st.just("") | WORDS, st.none() | SECONDS, st.none() | SECONDS)
def test_a_fault_reads_back_as_it_is_written(what, how, begin_s, length_s):
    end_s = begin_s + length_s if begin_s is not None and length_s else None
    fault = FaultRequest(what, how, begin_s, None if end_s is None else round(end_s, 3))
    if max(begin_s or 0.0, end_s or 0.0) <= 1e6:
        assert parse_fault(str(fault)) == fault


@given(st.text())
def test_any_text_is_read_or_refused(text):
    try:
        parse_fault(text)
    except FaultError as error:
        assert str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("text", "there"),
    [
        ("zed", (True, True, True, True, True)),
        ("zed@30", (False, False, True, True, True)),
        ("zed@30-40", (False, False, True, True, False)),
    ],
)
def test_a_fault_lasts_from_its_beginning_to_its_end(text, there):
    fault = parse_fault(text)
    assert tuple(fault.lasts(since_s) for since_s in (None, 29.99, 30.0, 39.99, 40.0)) == there


def spans(*texts, lift_off_s=10.0, ended_s=100.0, first_s=None):
    found = spans_of([*map(parse_fault, texts)], begun_s=0.5, lift_off_s=lift_off_s, ended_s=ended_s, first_s=first_s)
    return [(str(span.request), span.at_s, span.until_s) for span in found]


def test_faults_come_when_they_were_asked_for_and_not_after_the_run():
    assert spans("zed@50", "zed@20-30", "lidar@95") == [("zed@20-30", 30.0, 40.0), ("zed@50", 60.0, math.inf)]
    assert spans("zed", "lidar@3") == [("zed", 0.5, math.inf), ("lidar@3", 13.0, math.inf)]
    assert spans("zed", "lidar@3", lift_off_s=None) == [("zed", 0.5, math.inf)], "nothing has lifted off"


def test_faults_of_mocks_count_from_when_mocks_say_that_the_first_came():
    first_s = {"zed:dark": 32.0, "zed": 0.2}
    assert spans("zed:dark@20-21", "zed:dark@40", first_s=first_s) == [("zed:dark@20-21", 32.0, 33.0), ("zed:dark@40", 52.0, math.inf)]
    assert spans("zed", "zed@20", first_s=first_s) == [("zed", 0.2, math.inf), ("zed@20", 30.0, math.inf)]
    assert spans("lidar@20", first_s=first_s) == [], "mocks do not tell of it: it never came"


def test_begins_and_ends_are_told_in_the_order_of_time_until_the_end():
    requests = [parse_fault(text) for text in ("zed@50-120", "zed:dark@20-30", "lidar@25")]
    changes = changes_of(spans_of(requests, begun_s=0.0, lift_off_s=10.0, ended_s=100.0), 100.0, "mock")
    told = [(change.sensor, change.mode, change.t_s) for change in changes]
    assert told == [("zed", "dark", 30.0), ("lidar", "mock", 35.0), ("zed", MENDED, 40.0), ("zed", "mock", 60.0)]
