"""Calls over rclpy that end whatever gets lost, and jobs at moments of a clock, without a graph."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from skillset_ros2 import calls as calls_module
from skillset_ros2.calls import AGAIN_S, LOOK_S, QUEUE, UNSEEN_S, WINDOW, Calls, Discovery
from skillset_ros2.timers import RclpyTimers


class Future:
    """An answer that the test gives."""

    def __init__(self, request) -> None:
        self.request = request
        self.told = []

    def add_done_callback(self, callback) -> None:
        self.told.append(callback)

    def answer(self, response) -> None:
        self.result = lambda: response
        for callback in self.told:
            callback(self)


class Service:
    """rclpy's client of a service."""

    srv_name = "ask"

    def __init__(self) -> None:
        self.there = True
        self.sent: list[Future] = []

    def service_is_ready(self) -> bool:
        return self.there

    def call_async(self, request) -> Future:
        self.sent.append(Future(request))
        return self.sent[-1]


@pytest.fixture
def bench(monkeypatch):
    now = SimpleNamespace(s=100.0, jobs=[], awaited=[])
    monkeypatch.setattr(calls_module.time, "monotonic", lambda: now.s)
    service = Service()
    calls = Calls(service, lambda delay_s, job: now.jobs.append((now.s + delay_s, job)), now.awaited.append)
    answers: list = []

    def ask(request, *, timeout_s=5.0, once=False) -> None:
        calls.call(request, lambda r, tries: answers.append((r, tries)), answers.append, timeout_s=timeout_s, once=once)

    def run_for(seconds: float) -> None:
        end_s = now.s + seconds
        while (due := [job for job in now.jobs if job[0] <= end_s]) and (first := min(due, key=lambda job: job[0])):
            now.jobs.remove(first)
            now.s = max(now.s, first[0])  # a process that could not run is late for it
            first[1]()
        now.s = end_s

    return SimpleNamespace(service=service, calls=calls, ask=ask, run_for=run_for, answers=answers, now=now)


def test_each_call_ends_once_where_answers_come_while_the_client_is_closed(bench):
    def refuse(reason: str) -> None:
        bench.answers.append(f"a {reason}")
        bench.service.sent[1].answer("in between")

    bench.calls.call("a", lambda *_: None, refuse, timeout_s=60.0, once=False)
    tell = bench.answers.append
    bench.calls.call("b", lambda *_: tell("b answered"), lambda _: tell("b refused"), timeout_s=60.0, once=False)
    bench.calls.close()
    assert bench.answers == ["a service ask: this client was closed", "b answered"]


def test_what_is_withdrawn_is_not_asked_again_and_gives_no_answer(bench):
    withdraw = bench.calls.call("a", lambda *_: bench.answers.append("a"), bench.answers.append, timeout_s=60.0, once=False)
    bench.ask("b", timeout_s=60.0)
    withdraw()
    bench.run_for(3 * (AGAIN_S + LOOK_S))
    assert [future.request for future in bench.service.sent].count("a") == 1
    assert [future.request for future in bench.service.sent].count("b") > 1
    bench.service.sent[0].answer("late")
    withdraw()
    assert bench.answers == []


def test_an_answer_comes_once_and_with_the_number_of_tries(bench):
    bench.ask("a")
    bench.run_for(AGAIN_S + LOOK_S + 0.1)
    assert [future.request for future in bench.service.sent] == ["a", "a"]
    bench.service.sent[0].answer("late")
    bench.service.sent[1].answer("twice")
    assert bench.answers == [("late", 2)]
    assert (bench.now.awaited[0], bench.now.awaited[-1]) == (True, False)


def test_time_in_which_the_process_could_not_run_does_not_count(bench):
    bench.ask("a", timeout_s=1.0, once=True)
    bench.run_for(2 * LOOK_S)
    bench.now.s += 60.0  # the answer has arrived meanwhile, and waits for the executor
    bench.run_for(LOOK_S)
    assert bench.answers == []
    bench.service.sent[0].answer("late")
    assert bench.answers == [("late", 1)]
    bench.ask("b", timeout_s=1.0, once=True)
    bench.now.s += 60.0
    bench.run_for(1.0 + 3 * LOOK_S)
    assert bench.answers[1:] == ["service ask did not answer within 1 s"]


def test_what_must_not_be_done_twice_is_asked_once(bench):
    bench.ask("a", once=True)
    bench.run_for(4.0)
    assert len(bench.service.sent) == 1
    bench.run_for(2.0)
    assert bench.answers == ["service ask did not answer within 5 s"]


def test_a_service_that_is_not_there_is_told_and_one_that_comes_is_asked(bench):
    bench.service.there = False
    bench.ask("a", timeout_s=1.0)
    bench.ask("b", timeout_s=20.0)
    bench.run_for(2.0)
    assert bench.answers == ["service ask is not there within 1 s"]
    bench.service.there = True
    bench.run_for(LOOK_S)
    assert [future.request for future in bench.service.sent] == ["b"]


def test_a_service_that_the_graph_never_tells_of_is_asked_all_the_same(bench):
    bench.service.there = False
    for request in ("a", "b"):
        bench.ask(request, timeout_s=20.0)
    bench.run_for(UNSEEN_S - LOOK_S)
    assert bench.service.sent == []
    bench.run_for(2 * LOOK_S)
    assert [future.request for future in bench.service.sent] == ["a"]
    bench.service.sent[0].answer("yes")
    assert bench.calls.ready
    assert [future.request for future in bench.service.sent] == ["a", "b"]
    bench.ask("c")
    assert [future.request for future in bench.service.sent] == ["a", "b", "c"]


def test_a_service_that_went_is_waited_for_whether_the_graph_told_of_it_or_not(bench):
    bench.ask("a")
    bench.service.there = False
    bench.service.sent[0].answer("its last answer")
    bench.ask("b", timeout_s=20.0, once=True)
    assert [future.request for future in bench.service.sent] == ["a"]
    bench.run_for(UNSEEN_S + LOOK_S)
    bench.service.sent[1].answer("unseen")
    bench.ask("c", timeout_s=20.0)
    bench.run_for(AGAIN_S + LOOK_S)
    bench.ask("d", timeout_s=20.0, once=True)
    assert [future.request for future in bench.service.sent] == ["a", "b", "c"]
    assert not bench.calls.ready
    bench.service.there = True
    bench.run_for(LOOK_S)
    assert "d" in [future.request for future in bench.service.sent]


def test_a_request_that_must_not_be_made_twice_is_sent_unseen_once_and_given_up_in_its_time(bench):
    bench.service.there = False
    bench.ask("a", once=True)
    bench.run_for(5.0 + 2 * LOOK_S)
    assert len(bench.service.sent) == 1
    assert bench.answers == ["service ask did not answer within 5 s"]


def test_an_end_is_taken_for_connected_when_the_graph_tells_of_it_or_has_had_time_to(bench):
    told = SimpleNamespace(there=False)
    discovery = Discovery(lambda: told.there)
    assert not discovery()
    bench.run_for(UNSEEN_S + LOOK_S)
    assert discovery()
    told.there = True
    assert discovery()
    told.there = False
    assert not discovery(), "an end that went gets its time again"


def test_a_burst_goes_through_a_window_and_no_request_is_lost(bench):
    for number in range(4 * WINDOW):
        bench.ask(number)
    assert len(bench.service.sent) == WINDOW
    for number in range(4 * WINDOW):
        bench.service.sent[number].answer(number)
    assert [answer for answer, _ in bench.answers] == list(range(4 * WINDOW))


def test_a_full_queue_is_told_at_once(bench):
    bench.service.there = False
    for number in range(QUEUE + 1):
        bench.ask(number)
    assert bench.answers == [f"service ask: {QUEUE} requests wait for it already"]


def test_a_closed_client_answers_all(bench):
    bench.ask("a")
    bench.calls.close()
    bench.ask("b")
    assert bench.answers == ["service ask: this client was closed"] * 2


class Node:
    """Node, clock, timer and guard condition in one."""

    def __init__(self) -> None:
        self.nanoseconds = 1000
        self.timer_period_ns = 0
        self.runs = False
        self.wakes = 0

    def now(self):
        return self

    def create_timer(self, period_s, ring, **_):
        self.ring = ring
        return self

    def create_guard_condition(self, wake, **_):
        self.wake = wake
        return SimpleNamespace(trigger=self.trigger)

    def trigger(self) -> None:
        self.wakes += 1

    def reset(self) -> None:
        self.runs = True

    def cancel(self) -> None:
        self.runs = False


def test_jobs_ring_in_order_and_only_the_first_wakes_the_executor():
    node, done = Node(), []
    timers = RclpyTimers(node, node, None, lambda: False)
    timers.at(1070, lambda: done.append("late"))
    timers.at(1080, lambda: done.append("never")).cancel()
    timers.at(1090, lambda: done.append("last"))
    timers.at(1050, lambda: done.append("early"))
    assert node.wakes == 2
    node.wake()
    assert (node.runs, node.timer_period_ns) == (True, 50)
    node.nanoseconds = 1075
    node.ring()
    assert (done, node.runs, node.timer_period_ns) == (["early", "late"], True, 15)
    node.nanoseconds = 1100
    node.ring()
    assert (done[2:], node.runs) == (["last"], False)


def test_a_job_that_raises_leaves_the_timer_set_for_the_others():
    node, done = Node(), []
    timers = RclpyTimers(node, node, None, lambda: True)
    timers.at(1010, lambda: 1 / 0)
    timers.at(1020, lambda: done.append("next"))
    node.nanoseconds = 1010
    with pytest.raises(ZeroDivisionError):
        node.ring()
    assert (node.wakes, node.runs, node.timer_period_ns) == (0, True, 10)


def test_a_call_that_is_made_while_the_client_is_closed_is_refused_once(bench):
    class Closing:
        """The lock of a client that another thread closes as soon as it is free."""

        def __init__(self) -> None:
            self.lock = threading.Lock()

        def __enter__(self) -> None:
            self.lock.acquire()

        def __exit__(self, *_: object) -> None:
            self.lock.release()
            bench.calls._lock = self.lock
            bench.calls.close()

    bench.calls._lock = Closing()
    bench.ask("a")
    assert bench.answers == ["service ask: this client was closed"]
