"""What a client does when managers say nothing, come back, are others, or are two; over a middleware that does what the test says."""

from __future__ import annotations

import pytest

from alula.model.execution_state import ExecutionState
from alula.model.json_form import to_json
from alula.runtime.client import Client
from alula.runtime.client.connection import DESCRIBE_S, DOUBT_S, RIVALS_NS
from alula.runtime.client.goal import ACKNOWLEDGE_LIMIT, ACKNOWLEDGE_S, GRACE_S, LOST_S, SILENCE_S
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from alula.runtime.local import VirtualClock
from alula.runtime.middleware import EVENTS, RESOURCE_STATES, GoalResult, ResourceStates, ResourceStatus
from alula.runtime.waiting import ThreadWaiter
from alula_testing.runtime_models import flying_skillset

S = ExecutionState
MODEL = flying_skillset()


class Link:
    """A skill's action whose server does nothing by itself."""

    connected = True

    def __init__(self) -> None:
        self.sent: dict[str, object] = {}
        self.cancelled: list[str] = []
        self.asked: list[str] = []

    def fit(self, inputs, place):
        return dict(inputs)

    def outputs_of(self, plain):
        return dict(plain)

    def send(self, goal_id, goal, on_answer):
        self.sent[goal_id] = on_answer

    def cancel(self, goal_id):
        self.cancelled.append(goal_id)

    def request_result(self, goal_id):
        self.asked.append(goal_id)

    def release(self, goal_id):
        pass


class Graph:
    """A middleware of a client; the test is the managers."""

    waiter = ThreadWaiter()

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.received: dict[str, object] = {}
        self.link = Link()
        self.errors: list[str] = []
        self.silent = False
        self.sequence = 0

    now_ns = lambda self: self.clock.now_ns  # noqa: E731
    at = lambda self, when_ns, job: self.clock.at(when_ns, job)  # noqa: E731
    later = lambda self, delay_s, job: self.clock.after(delay_s, job)  # noqa: E731
    when = lambda self, condition, job: job() if condition() else None  # noqa: E731
    log = lambda self, error: self.errors.append(error)  # noqa: E731
    new_id = lambda self: f"{len(self.link.sent) + 1:012x}"  # noqa: E731
    action = lambda self, skill, listener: self.link  # noqa: E731

    def subscribe(self, topic, callback):
        self.received[topic.name] = callback
        return lambda: True

    def watch(self, on_heartbeat, on_doubt):
        self.heartbeat, self.doubt = on_heartbeat, on_doubt

    def call(self, service, request, on_reply, on_error, *, timeout_s=5.0, once=False):
        if self.silent:
            self.later(timeout_s, lambda: on_error("no answer"))
        else:
            on_reply(to_json(MODEL), 1)

    def run_for(self, seconds: float) -> None:
        until_ns = self.clock.now_ns + round(seconds * 1e9)
        while self.clock.do_next(until_ns):
            pass

    def states(self, instance_id: str, after: int = 0, **resources: str) -> None:
        values = {name: ResourceStatus(state, "", 0) for name, state in resources.items()}
        self.received[RESOURCE_STATES.name](ResourceStates(instance_id, after, self.clock.now_ns, values))

    def tell(self, instance_id: str, handle, state: ExecutionState, sequence: int = 0) -> None:
        self.sequence = sequence or self.sequence + 1
        event = ExecutionEvent(self.sequence, self.clock.now_ns, "takeoff", handle.id, state, "", "", {}, {}, instance_id=instance_id)
        self.received[EVENTS.name](event)


@pytest.fixture
def graph():
    return Graph()


@pytest.fixture
def client(graph):
    client = Client(graph, "flying")
    graph.heartbeat("one")
    graph.states("one", sdk="AVAILABLE")
    assert client.ready
    return client


def running(graph, client):
    handle = client.start("takeoff", height=3.0)
    graph.tell("one", handle, S.REQUESTED)
    graph.tell("one", handle, S.RUNNING)
    assert handle.state is S.RUNNING
    return handle


def gone(graph):
    graph.silent = True
    graph.doubt()
    graph.run_for(1.5)
    graph.silent = False


def test_an_unacknowledged_goal_is_given_up_and_cancelled_when_it_is_heard_of(graph, client):
    handle = client.start("takeoff", height=3.0)
    graph.run_for(ACKNOWLEDGE_S - 0.1)
    assert not handle.done
    graph.run_for(0.2)
    assert (handle.state, handle.message) == (S.FAILED, "the managers of flying did not answer within 5 s")
    graph.tell("one", handle, S.REQUESTED)
    assert graph.link.cancelled == [handle.id]


def test_managers_that_are_busy_with_others_are_given_more_time_but_not_for_ever(graph, client):
    handle, other = client.start("takeoff", height=3.0), client.start("takeoff", height=4.0)
    for _ in range(ACKNOWLEDGE_LIMIT - 1):
        graph.tell("one", other, S.RUNNING)
        graph.run_for(ACKNOWLEDGE_S)
        assert not handle.done
    graph.tell("one", other, S.RUNNING)
    graph.run_for(ACKNOWLEDGE_S)
    assert (handle.state, other.state) == (S.FAILED, S.RUNNING)


def test_a_goal_that_was_taken_and_is_not_told_of_is_asked_for(graph, client):
    handle = client.start("takeoff", height=3.0)
    graph.link.sent[handle.id](True)
    graph.run_for(SILENCE_S + 0.1)
    assert (handle.done, graph.link.asked) == (False, [handle.id])
    client._sync.on_result(handle.id, None)
    assert (handle.state, "do not know this execution" in handle.message) == (S.FAILED, True)


def test_a_gap_in_the_events_has_the_endings_asked_for(graph, client):
    handle = running(graph, client)
    graph.received[EVENTS.name](TransitionEvent(9, 0, "sdk", "A", "B", "extern", instance_id="one"))
    assert graph.link.asked == [handle.id]
    client._sync.on_result(handle.id, GoalResult(S.TERMINATED, "DONE", "there", {}))
    assert not handle.done  # its event may still come, and say when it was
    graph.run_for(LOST_S)
    assert (handle.state, handle.result) == (S.TERMINATED, "DONE")


def test_a_result_that_comes_long_before_its_event_waits_for_what_has_led_to_it(graph, client):
    handle = running(graph, client)
    seen = []
    handle.add_done_callback(lambda _: seen.append((graph.clock.now_ns, client.resources)))
    client._sync.on_result(handle.id, GoalResult(S.RESOURCE_INVARIANT_VIOLATED, "has_sdk", "", {}))
    graph.run_for(GRACE_S - 1.0)
    graph.received[EVENTS.name](TransitionEvent(3, 0, "sdk", "AVAILABLE", "UNAVAILABLE", "extern", instance_id="one"))
    graph.tell("one", handle, S.RESOURCE_INVARIANT_VIOLATED, sequence=4)
    graph.run_for(GRACE_S - 1.0)
    assert seen == []
    graph.states("one", after=3, sdk="UNAVAILABLE")
    assert seen == [(round(2e9 * (GRACE_S - 1.0)), {"sdk": "UNAVAILABLE"})]


def test_a_state_is_shown_when_the_event_that_has_led_to_it_was_told(graph, client):
    seen = []
    client.on_event(lambda event: seen.append(event.sequence))
    client.on_change(lambda states: seen.append(states["sdk"]))
    graph.states("one", after=1, sdk="UNAVAILABLE")
    graph.states("one", after=2, sdk="AVAILABLE")
    assert (seen, client.resources) == ([], {"sdk": "AVAILABLE"})
    for sequence, before, after in ((1, "AVAILABLE", "UNAVAILABLE"), (2, "UNAVAILABLE", "AVAILABLE")):
        graph.received[EVENTS.name](TransitionEvent(sequence, 0, "sdk", before, after, "extern", instance_id="one"))
    assert seen == [1, "UNAVAILABLE", 2, "AVAILABLE"]


def test_a_state_whose_event_got_lost_is_shown_all_the_same_and_none_of_managers_that_are_no_more(graph, client):
    graph.states("one", after=1, sdk="UNAVAILABLE")
    graph.run_for(GRACE_S)
    assert client.resources == {"sdk": "UNAVAILABLE"}
    graph.states("one", after=2, sdk="AVAILABLE")
    graph.heartbeat("two")
    graph.states("two", sdk="UNAVAILABLE")
    graph.run_for(GRACE_S)
    assert client.resources == {"sdk": "UNAVAILABLE"}


def test_an_end_whose_event_never_comes_is_told_all_the_same(graph, client):
    handle = running(graph, client)
    client._sync.on_result(handle.id, GoalResult(S.TERMINATED, "DONE", "there", {}))
    graph.run_for(GRACE_S)
    assert (handle.state, handle.result) == (S.TERMINATED, "DONE")


def test_an_end_is_told_when_the_resources_after_it_are_known(graph, client):
    handle = running(graph, client)
    graph.received[EVENTS.name](TransitionEvent(3, 0, "axes", "USED", "AVAILABLE", "takeoff", instance_id="one"))
    graph.tell("one", handle, S.TERMINATED, sequence=4)
    assert not handle.done
    seen = []
    handle.add_done_callback(lambda _: seen.append(client.resources))
    graph.states("one", after=3, axes="AVAILABLE")
    assert seen == [{"axes": "AVAILABLE"}]


def test_what_was_given_up_with_managers_that_were_only_frozen_is_cancelled(graph, client):
    handle = running(graph, client)
    gone(graph)
    assert (handle.state, client.ready, client.resources) == (S.FAILED, False, {})
    assert graph.link.cancelled == []
    graph.heartbeat("one")
    assert graph.link.cancelled == [handle.id]
    assert (client.ready, client.resources) == (True, {"sdk": "AVAILABLE"})


def test_managers_that_are_slow_to_describe_themselves_are_asked_until_they_do(graph, client):
    graph.silent = True
    graph.heartbeat("two")
    graph.states("two", sdk="UNAVAILABLE")
    graph.run_for(3 * DESCRIBE_S)
    assert not client.ready
    graph.silent = False
    graph.run_for(DESCRIBE_S + DOUBT_S)
    assert (client.ready, client.resources) == (True, {"sdk": "UNAVAILABLE"})


def test_nothing_is_cancelled_at_managers_that_are_others(graph, client):
    handle = running(graph, client)
    gone(graph)
    graph.heartbeat("two")
    graph.states("two", sdk="UNAVAILABLE")
    assert (graph.link.cancelled, client.ready, client.resources) == ([], True, {"sdk": "UNAVAILABLE"})
    assert handle.state is S.FAILED


def test_a_goal_that_was_given_up_on_its_way_is_cancelled_at_managers_that_were_started_anew(graph, client):
    handle = client.start("takeoff", height=3.0)
    graph.run_for(ACKNOWLEDGE_S + 0.1)
    assert handle.state is S.FAILED
    graph.heartbeat("two")
    graph.states("two", sdk="AVAILABLE")
    graph.tell("two", handle, S.REQUESTED)
    assert graph.link.cancelled == [handle.id]
    graph.tell("two", handle, S.INTERRUPTED)
    graph.tell("two", handle, S.INTERRUPTED, sequence=9)
    assert graph.link.cancelled == [handle.id]


def test_managers_that_were_started_anew_do_not_know_what_runs(graph, client):
    handle = running(graph, client)
    graph.heartbeat("two")
    assert (handle.state, "restarted" in handle.message) == (S.FAILED, True)
    graph.states("one", after=99, sdk="BROKEN")  # late, of those that are no more
    assert client.resources == {"sdk": "AVAILABLE"}


def test_two_managers_at_a_time_are_told(graph, client):
    graph.heartbeat("two")
    graph.states("one")
    assert graph.errors == []  # late, or not
    graph.run_for(2 * RIVALS_NS / 1e9)
    graph.states("one")
    assert graph.errors == ["two processes manage the skillset flying; end one of them"]


def test_a_late_heartbeat_of_managers_that_were_killed_is_no_second_process(graph, client):
    graph.states("two", sdk="AVAILABLE")
    graph.run_for(2 * RIVALS_NS / 1e9)
    graph.heartbeat("one")  # DDS says that other managers live before it says which
    assert graph.errors == []
    graph.heartbeat("one", graph.clock.now_ns)
    assert graph.errors == ["two processes manage the skillset flying; end one of them"]


def test_a_callback_that_raises_keeps_no_handle_open(graph, client):
    handle = running(graph, client)
    client.on_event(lambda event: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        graph.tell("one", handle, S.INTERRUPTED)
    assert handle.state is S.INTERRUPTED


def test_a_closed_client_asks_for_nothing(graph, client):
    graph.close = lambda: None
    handle = running(graph, client)
    client.close()
    assert (handle.message, client.ready) == ("the client of flying was closed", False)
    assert client.transition("sdk", "AVAILABLE").failure == "the client of flying was closed"
    assert client.interrupt_all("takeoff").failure == "the client of flying was closed"
    assert client.start("takeoff", height=3.0).message == "the managers of flying are not there"
    graph.tell("one", handle, S.TERMINATED)
    assert graph.link.cancelled == []
