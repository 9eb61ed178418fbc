"""Events that a signal's handler sets."""

from __future__ import annotations

import signal
import threading

import pytest

from alula.common.signals import StopEvent


@pytest.fixture
def told(request):
    """Have SIGUSR1 set an event; the handler runs in the main thread, wherever that is."""
    event = StopEvent()
    before = signal.signal(signal.SIGUSR1, lambda *_: event.set())
    yield event
    signal.signal(signal.SIGUSR1, before)


def test_a_signal_that_comes_while_the_main_thread_holds_the_events_lock_sets_it(told):
    with told._cond:  # as in the middle of a wait, or of the handler of a signal before
        assert isinstance(told._cond, threading.Condition)
        signal.raise_signal(signal.SIGUSR1)
    assert told.is_set()


def test_one_signal_in_the_handler_of_another_sets_it_too(told):
    notify_all, calls = told._cond.notify_all, []

    def interrupted() -> None:
        calls.append(1)
        if len(calls) < 3:
            signal.raise_signal(signal.SIGUSR1)
        notify_all()

    told._cond.notify_all = interrupted
    signal.raise_signal(signal.SIGUSR1)
    assert told.is_set()
    assert len(calls) == 3
    assert told.wait(0.0)
