"""Faults: one grammar, every error with what would be right."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from alula_common.faults import FaultError, FaultRequest, parse_fault, parse_faults

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
