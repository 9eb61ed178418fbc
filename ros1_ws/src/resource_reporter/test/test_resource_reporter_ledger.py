"""The ledger: what is asked for, and when."""

from __future__ import annotations

from hypothesis import given
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
    ledger.reached(Call("a", "OK"), 0.0)
    ledger.observe({"a": "UNKNOWN"})
    assert ledger.next_call(0.001) is None
    ledger.observe({"a": "OK"})
    assert ledger.next_call(1.0) is None


def test_a_skillset_that_restarts_is_told_again():
    ledger = Ledger()
    ledger.observe({"a": "UNKNOWN"})
    ledger.want("a", "BROKEN")
    ledger.reached(Call("a", "BROKEN"), 0.0)
    ledger.observe({"a": "BROKEN"})
    ledger.observe({"a": "UNKNOWN"})
    assert ledger.next_call(10.0) == Call("a", "BROKEN")


def test_it_is_settled_once_the_skillset_knows_whatever_it_says():
    ledger = Ledger()
    assert ledger.settled, "nothing was reported"
    ledger.want("a", "OK")
    assert not ledger.settled, "the skillset has not shown its states"
    ledger.observe({"a": "UNKNOWN"})
    assert not ledger.settled
    ledger.refused(Call("a", "OK"), "no answer", 0.0, answered=False)
    assert not ledger.settled, "it may know nothing of it"
    ledger.reached(Call("a", "OK"), 0.1)
    assert ledger.settled, "it has answered"
    ledger.observe({"a": "OK"})
    ledger.want("a", "UNKNOWN")
    ledger.refused(Call("a", "UNKNOWN"), "no arrow", 0.2)
    assert ledger.settled, "it will have none of it, but it knows"
    ledger.want("a", "BROKEN")
    assert not ledger.settled, "an answer counts for the state that it answered"
    ledger.want("a", "OK", "why", insist=True)
    assert ledger.settled, "a reason alone holds nothing up"
    ledger.observe({"a": "UNKNOWN"})
    assert not ledger.settled, "a skillset that restarts knows nothing"


def test_a_resource_that_the_skillset_lacks_or_that_is_not_insisted_on_holds_nothing_up():
    ledger = Ledger()
    ledger.observe({"a": "OK"})
    ledger.want("b", "OK")
    ledger.want("a", "BROKEN", "why", insist=False)
    assert ledger.settled


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


def test_an_answer_that_is_older_than_the_state_shown_last_does_not_hide_it():
    """An abandoned call may be executed after its successor, and the successor's answer come last of all."""
    ledger = Ledger()
    ledger.observe({"a": "UNKNOWN"})
    ledger.want("a", "BROKEN")
    ledger.observe({"a": "BROKEN"})
    ledger.observe({"a": "OK"})
    ledger.reached(Call("a", "BROKEN"), 0.0)
    assert ledger.next_call(LONGEST_RETRY_S) == Call("a", "BROKEN")


class LateSkillset:
    """A skillset whose answers and shown states come late, each over a connection of its own."""

    def __init__(self) -> None:
        self.ledger = Ledger()
        self.actual = dict.fromkeys(NAMES, "UNKNOWN")
        self.shown = [dict(self.actual)]
        self.now_s = 0.0
        self.calls: list[Call] = []
        self.answer: tuple[Call, bool] | None = None

    def show(self) -> None:
        if self.shown:
            self.ledger.observe(self.shown.pop(0))

    def execute(self, call: Call) -> bool:
        """Make the transition; return whether the resource has the state asked for then."""
        if (self.actual[call.resource], call.to) in ARROWS:
            self.actual[call.resource] = call.to
            self.shown.append(dict(self.actual))
        return self.actual[call.resource] == call.to

    def call(self) -> None:
        """Execute the next call, unless one is not answered yet: the reporter makes one at a time."""
        call = self.ledger.next_call(self.now_s) if self.answer is None else None
        if call is not None:
            self.calls.append(call)
            self.answer = (call, self.execute(call))

    def abandon(self) -> None:
        """Execute a call of before again: its caller has given it up."""
        if self.calls:
            self.execute(self.calls[0])

    def fail(self) -> None:
        """Lose a call on its way."""
        call = self.ledger.next_call(self.now_s) if self.answer is None else None
        if call is not None:
            self.answer = (call, False)

    def reply(self) -> None:
        if self.answer is not None:
            (call, reached), self.answer = self.answer, None
            if reached:
                self.ledger.reached(call, self.now_s)
            else:
                self.ledger.refused(call, "failed", self.now_s)

    def restart(self) -> None:
        self.actual = dict.fromkeys(NAMES, "UNKNOWN")
        self.shown.append(dict(self.actual))


happenings = st.sampled_from(["show", "call", "abandon", "fail", "reply", "restart"])


@given(st.lists(st.one_of(st.tuples(st.sampled_from(NAMES), st.sampled_from(["OK", "BROKEN"])), happenings), max_size=60))
def test_whatever_happens_the_skillset_ends_with_the_last_reports(events):
    skillset, wanted = LateSkillset(), {}
    for event in events:
        skillset.now_s += 0.01
        if isinstance(event, str):
            getattr(skillset, event)()
        else:
            wanted[event[0]] = event[1]
            skillset.ledger.want(*event)
    for _ in range(12):
        skillset.now_s += LONGEST_RETRY_S
        while skillset.shown:
            skillset.show()
        skillset.reply()
        skillset.call()
    assert {name: skillset.actual[name] for name in wanted} == wanted


def test_a_reason_is_asked_for_with_its_state_and_again_when_it_changes():
    ledger = Ledger()
    ledger.observe({"a": "OK"})
    assert ledger.want("a", "BROKEN", "it is dark")
    call = ledger.next_call(0.0)
    assert call is not None
    assert (call, call.reason) == (Call("a", "BROKEN"), "it is dark")
    ledger.observe({"a": "BROKEN"}, {"a": "it is dark"})
    assert not ledger.want("a", "BROKEN", "it is dark")
    assert ledger.next_call(10.0) is None
    assert ledger.want("a", "BROKEN", "it is covered")
    call = ledger.next_call(10.0)
    assert call is not None
    assert call.reason == "it is covered"
    ledger.reached(call, 10.0)
    ledger.want("a", "BROKEN", "it is cold")
    assert ledger.next_call(10.1) is None, "reasons that change often are told no more often than calls are repeated"
    assert ledger.next_call(10.2) is not None


def test_a_reason_without_insistence_asks_for_no_transition():
    ledger = Ledger()
    ledger.observe({"a": "OK"})
    ledger.want("a", "UNKNOWN", "no driver", insist=False)
    assert ledger.next_call(0.0) is None
    ledger.observe({"a": "UNKNOWN"})
    assert ledger.next_call(0.0) == Call("a", "UNKNOWN")
