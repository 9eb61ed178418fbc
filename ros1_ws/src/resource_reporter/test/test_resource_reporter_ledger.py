"""The ledger: what is asked for, and when."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from resource_reporter.ledger import FIRST_RETRY_S, LONGEST_RETRY_S, Call, Ledger

NAMES, STATES = ["a", "b"], ["UNKNOWN", "OK", "BROKEN"]
ARROWS = {("UNKNOWN", "OK"), ("UNKNOWN", "BROKEN"), ("OK", "BROKEN"), ("BROKEN", "OK")}


def test_asks_nothing_before_the_skillset_has_shown_its_states():
    ledger = Ledger()
    ledger.want("a", "OK")
    assert ledger.next_call(0.0) is None
    assert ledger.wait_s(0.0) is None
    ledger.observe({"a": "UNKNOWN"})
    assert ledger.next_call(0.0) == Call("a", "OK")


def test_asks_nothing_when_all_agree():
    ledger = Ledger()
    ledger.observe({"a": "OK"})
    assert ledger.want("a", "OK")
    assert not ledger.want("a", "OK")
    assert ledger.next_call(0.0) is None


def test_an_older_state_shown_after_the_answer_is_not_believed_at_once():
    ledger = Ledger()
    ledger.observe({"a": "UNKNOWN"})
    ledger.want("a", "OK")
    ledger.accepted(Call("a", "OK"), "OK", 0.0)
    ledger.observe({"a": "UNKNOWN"})
    assert ledger.next_call(0.001) is None
    ledger.observe({"a": "OK"})
    assert ledger.next_call(1.0) is None


def test_a_skillset_that_starts_anew_is_told_again():
    ledger = Ledger()
    ledger.observe({"a": "UNKNOWN"})
    ledger.want("a", "BROKEN")
    ledger.accepted(Call("a", "BROKEN"), "BROKEN", 0.0)
    ledger.observe({"a": "BROKEN"})
    ledger.observe({"a": "UNKNOWN"})
    assert ledger.next_call(10.0) == Call("a", "BROKEN")


def test_a_new_state_is_asked_for_at_once_though_the_last_one_was_refused():
    ledger = Ledger()
    ledger.observe({"a": "OK"})
    ledger.want("a", "UNKNOWN")
    assert ledger.refused(Call("a", "UNKNOWN"), "no arrow", 0.0)
    assert ledger.next_call(0.0) is None
    ledger.want("a", "BROKEN")
    assert ledger.next_call(0.0) == Call("a", "BROKEN")


def test_retries_back_off_to_a_fifth_of_a_second_and_each_reason_is_told_once():
    ledger = Ledger()
    ledger.observe({"a": "OK"})
    ledger.want("a", "UNKNOWN")
    now_s, waits, told = 0.0, [], []
    for reason in ["no service", "no service", "no arrow", "no arrow", "no arrow"]:
        told.append(ledger.refused(Call("a", "UNKNOWN"), reason, now_s))
        wait_s = ledger.wait_s(now_s)
        assert ledger.next_call(now_s + wait_s - 0.001) is None
        waits.append(round(wait_s, 6))
        now_s += wait_s
        assert ledger.next_call(now_s) is not None
    assert waits == [FIRST_RETRY_S, 0.05, 0.1, LONGEST_RETRY_S, LONGEST_RETRY_S]
    assert told == [True, False, True, False, False]


def test_a_change_of_the_skillset_makes_a_refused_call_due_again():
    ledger = Ledger()
    ledger.observe({"a": "UNKNOWN"})
    ledger.want("a", "OK")
    for _ in range(5):
        ledger.refused(Call("a", "OK"), "not now", 0.0)
    ledger.observe({"a": "BROKEN"})
    assert ledger.next_call(0.0) == Call("a", "OK")


def test_resources_that_the_skillset_lacks_are_named_and_never_asked_for():
    ledger = Ledger()
    ledger.want("nosuch", "OK")
    assert ledger.unknown() == []
    ledger.observe({"a": "OK"})
    assert ledger.unknown() == ["nosuch"]
    assert ledger.next_call(0.0) is None


reports = st.tuples(st.just("report"), st.sampled_from(NAMES), st.sampled_from(["OK", "BROKEN"]))
restarts = st.tuples(st.just("restart"), st.just(""), st.just(""))
fails = st.tuples(st.just("fail"), st.just(""), st.just(""))


@settings(deadline=None)
@given(st.lists(st.one_of(reports, restarts, fails), max_size=40))
def test_whatever_happens_the_skillset_ends_with_the_last_reports(events):
    ledger, actual, wanted, now_s = Ledger(), dict.fromkeys(NAMES, "UNKNOWN"), {}, 0.0
    ledger.observe(actual)

    def serve(*, fail: bool) -> None:
        call = ledger.next_call(now_s)
        if call is None:
            return
        assert actual[call.resource] != call.to
        assert wanted[call.resource] == call.to
        if fail or (actual[call.resource], call.to) not in ARROWS:
            ledger.refused(call, "failed", now_s)
        else:
            actual[call.resource] = call.to
            ledger.accepted(call, call.to, now_s)
            ledger.observe(actual)

    for kind, name, state in events:
        now_s += 0.01
        if kind == "report":
            wanted[name] = state
            ledger.want(name, state)
        elif kind == "restart":
            actual = dict.fromkeys(NAMES, "UNKNOWN")
            ledger.observe(actual)
        serve(fail=kind == "fail")
    for _ in range(6):
        now_s += LONGEST_RETRY_S
        serve(fail=False)
    assert {name: actual[name] for name in wanted} == wanted
