"""Which heartbeats are silent: by when they were heard, and not by when somebody looked."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from alula_base import Change, Heartbeats
from alula_base.heartbeats import HEARD, SILENT, UNHEARD

TOPICS = ("/a", "/b")
AFTER_S = 8.0
MESSAGES = st.lists(st.tuples(st.integers(1, 20), st.sampled_from(TOPICS)), max_size=20)
"""Each so many seconds after the one before; whole numbers, so that sums are exact."""
LOOKS = st.lists(st.integers(0, 400), max_size=30)


def play(messages: list[tuple[int, str]], looks: list[int]) -> tuple[Heartbeats, list[tuple[str, str]]]:
    """Return the heartbeats, and what changed, after these messages, with a look at these moments, and one at the end."""
    at_s, events = 0.0, [(float(moment_s), "") for moment_s in looks]
    for step_s, topic in messages:
        at_s += step_s
        events.append((at_s, topic))
    heartbeats, changes = Heartbeats(TOPICS, AFTER_S), []
    for now_s, topic in [*sorted(event for event in events if event[0] <= at_s), (at_s + 2 * AFTER_S, "")]:
        changes += heartbeats.hear(topic, now_s) if topic else heartbeats.look(now_s)
    return heartbeats, [(change.topic, change.state) for change in changes]


def expected(messages: list[tuple[int, str]], topic: str) -> list[str]:
    """Return the changes of a topic: heard, and silent after each gap that is too long."""
    at_s, last_s, states = 0, None, []
    for step_s, one in messages:
        at_s += step_s
        if one == topic:
            states += [HEARD] if last_s is None else [SILENT, HEARD] if at_s - last_s > AFTER_S else []
            last_s = at_s
    return states if last_s is None else [*states, SILENT]


@given(MESSAGES, LOOKS)
def test_each_gap_that_is_too_long_is_told_once_whoever_looks(messages, looks):
    heartbeats, changes = play(messages, looks)
    for topic in TOPICS:
        assert [state for one, state in changes if one == topic] == expected(messages, topic)
        assert heartbeats.states()[topic] == ((changes and expected(messages, topic) and SILENT) or UNHEARD)


@given(LOOKS)
def test_what_was_never_heard_is_never_silent(looks):
    heartbeats, changes = play([], looks)
    assert (heartbeats.state, changes, heartbeats.wait_s(1e6)) == (UNHEARD, [], None)


@given(MESSAGES)
def test_who_waits_as_long_as_told_misses_nothing(messages):
    heartbeats, now_s = Heartbeats(TOPICS, AFTER_S), 0.0
    for step_s, topic in messages:
        now_s += step_s
        heartbeats.hear(topic, now_s)
    wait_s = heartbeats.wait_s(now_s)
    if wait_s is not None:
        assert heartbeats.look(now_s + wait_s) == []
        assert heartbeats.look(now_s + wait_s + 1e-6)


def test_one_that_is_silent_still_hides_no_other():
    heartbeats = Heartbeats(TOPICS, 1.0)
    assert heartbeats.hear("/a", 0.0) == [Change("/a", HEARD)]
    assert heartbeats.hear("/b", 2.0) == [Change("/a", SILENT, 2.0), Change("/b", HEARD)]
    assert heartbeats.state == SILENT
    assert heartbeats.look(3.5) == [Change("/b", SILENT, 1.5)]
    assert heartbeats.hear("/b", 4.0) == [Change("/b", HEARD, 2.0)]
    assert heartbeats.state == SILENT, "the other one is silent still"
    assert heartbeats.hear("/a", 4.5) == [Change("/a", HEARD, 4.5)]
    assert (heartbeats.state, heartbeats.states()) == (HEARD, {"/a": HEARD, "/b": HEARD})
