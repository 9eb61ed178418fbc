"""What a client makes of managers that it can't call."""

from __future__ import annotations

import json
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st
from runtime_local_rig import make

from alula.model.json_form import to_json
from alula.model.model import Data
from alula.runtime.client.connection import Connection
from alula.runtime.core.events import TransitionEvent, event_record, read_event
from alula_testing.runtime_models import flying_skill, flying_skillset
from alula_testing.waits import HANGS_S

MODEL = to_json(flying_skillset())
ENOUGH_S = 0.05
"""So long another thread gets to subscribe as well, where nothing keeps it."""


class Managers:
    """A middleware with managers at its other end that describe themselves as ``model``."""

    def __init__(self, model: str) -> None:
        self.model = model
        self.types = True
        self.asked = 0
        self.logged: list[str] = []
        self.log = self.logged.append

    def call(self, _service, _request, on_reply, _on_error, *, timeout_s) -> None:
        self.asked += 1
        on_reply(self.model, 1)

    def action(self, skill, _listener):
        if not self.types:
            raise ModuleNotFoundError(f"there is no type of {skill}")
        return type("Link", (), {"connected": True})()

    def when(self, condition, job) -> None:
        if condition():
            job()

    def now_ns(self) -> int:
        return 0


def connection(managers: Managers) -> Connection:
    nothing = lambda: None  # noqa: E731
    return Connection(managers, "flying", None, on_restart=nothing, on_alive=nothing, on_gone=nothing)


@pytest.mark.parametrize(("model", "types"), [("{}", True), ("no JSON", True), ("null", True), (MODEL, False)])
def test_managers_that_can_not_be_called_are_told_of_once_and_their_next_ones_are_called(model, types):
    managers = Managers(model)
    managers.types = types
    known = connection(managers)
    for _ in range(3):
        known.on_heartbeat("old")
    assert managers.asked == 1
    (told,) = managers.logged
    assert told.startswith("the managers of flying can't be called: ")
    assert known.missing == "a description that can be used here"
    managers.model, managers.types = MODEL, True
    known.on_heartbeat("new")
    known.on_states()
    assert known.ready.is_set()
    assert known.missing == ""


def test_goals_that_have_ended_are_not_interrupted():
    world, client = make()
    for _ in range(3):
        handle = client.start("takeoff", height=1.0)
        assert world.run_until(lambda handle=handle: handle.done, timeout_s=10.0)
    assert client.interrupt_all("takeoff").get(1.0) == 0
    client.start("takeoff", height=1.0)
    world.run_for(0.5)
    assert client.interrupt_all("takeoff").get(1.0) == 1
    (managers,) = world.bus.served.values()
    world.run_for(5.0)
    assert [server.goals for server in managers.actions.values()] == [set()]


def test_a_data_that_two_threads_ask_for_at_once_is_subscribed_to_once():
    """The second thread comes while the first subscribes; it waits for that, and gets the same values."""
    _, client = make(flying_skillset(flying_skill("takeoff"), data=(Data("battery", "float64", period_s=1.0),)))
    begun, others = threading.Event(), []
    subscribe = client._middleware.subscribe
    topics = []

    def slowly(topic, callback):
        topics.append(topic)
        if not begun.is_set():
            begun.set()
            other = threading.Thread(target=lambda: others.append(client.data_feed("battery")))
            other.start()
            threads.append(other)
            other.join(ENOUGH_S)
        return subscribe(topic, callback)

    threads: list[threading.Thread] = []
    client._middleware.subscribe = slowly
    first = client.data_feed("battery")
    threads[0].join(HANGS_S)
    assert others == [first]
    assert len(topics) == 1


@given(st.integers(0, 2**21 * 10**9))
def test_stamps_of_the_first_days_of_a_clock_are_read_back_to_the_nanosecond(stamp_ns):
    event = TransitionEvent(1, stamp_ns, "axes", "FREE", "USED", "extern")
    assert read_event(json.loads(json.dumps(event_record(event)))) == event


@given(st.integers(10**18, 2 * 10**18))
def test_stamps_of_today_are_read_back_to_less_than_a_microsecond(stamp_ns):
    event = TransitionEvent(1, stamp_ns, "axes", "FREE", "USED", "extern")
    assert abs(read_event(json.loads(json.dumps(event_record(event)))).stamp_ns - stamp_ns) < 200
