from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

from uav_skills.calls import CallQueue, Response


@dataclass
class Future:
    callback: object = None
    response: object = None

    def add_done_callback(self, callback):
        self.callback = callback

    def result(self):
        return self.response

    def finish(self, **fields):
        self.response = SimpleNamespace(**fields)
        self.callback(self)


@dataclass
class FakeService:
    service_name: str
    ready: bool = True
    sent: list = field(default_factory=list)
    forgotten: list = field(default_factory=list)

    def service_is_ready(self):
        return self.ready

    def call_async(self, request):
        self.sent.append((request, Future()))
        return self.sent[-1][1]

    def remove_pending_request(self, future):
        self.forgotten.append(future)


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def test_calls_are_sent_in_order_each_after_the_response_to_the_one_before():
    goto, hover, responses = FakeService("/goto"), FakeService("/hover"), []
    queue = CallQueue(Clock())
    queue.submit(goto, "go", responses.append)
    queue.submit(hover, "stop", responses.append)
    assert len(goto.sent) == 1
    assert hover.sent == []
    goto.sent[0][1].finish(accepted=True, reason="", reference_id=5)
    assert len(hover.sent) == 1
    hover.sent[0][1].finish(success=False, message="no")
    assert responses == [Response(accepted=True, reference_id=5), Response(accepted=False, reason="no")]


def test_a_slow_response_does_not_hold_back_a_stop():
    takeoff, hover, clock, responses = FakeService("/takeoff"), FakeService("/hover"), Clock(), []
    queue = CallQueue(clock)
    queue.submit(takeoff, "up", responses.append)
    queue.submit(hover, "stop")
    clock.now = 0.25
    queue.tick()
    assert hover.sent == []
    clock.now = 0.35
    queue.tick()
    assert len(hover.sent) == 1
    takeoff.sent[0][1].finish(accepted=False, reason="another command came")
    assert responses == [Response(accepted=False, reason="another command came")]


def test_a_service_that_is_away_is_waited_for_and_then_given_up():
    away, there, clock, responses = FakeService("/away", ready=False), FakeService("/there"), Clock(), []
    queue = CallQueue(clock)
    queue.submit(away, "a", responses.append)
    queue.submit(there, "b")
    clock.now = 2.9
    queue.tick()
    assert there.sent == []
    clock.now = 3.1
    queue.tick()
    assert responses == [Response(accepted=False, answered=False, reason="service /away is not there for 3 s")]
    assert len(there.sent) == 1


def test_a_service_that_comes_back_in_time_is_called():
    service, clock = FakeService("/late", ready=False), Clock()
    queue = CallQueue(clock)
    queue.submit(service, "a")
    clock.now, service.ready = 2.0, True
    queue.tick()
    queue.tick()
    assert len(service.sent) == 1


def test_a_call_without_a_response_gets_one_here_once_that_is_no_refusal():
    service, clock, responses = FakeService("/mute"), Clock(), []
    queue = CallQueue(clock)
    queue.submit(service, "a", responses.append)
    clock.now = 21.0
    queue.tick()
    queue.tick()
    assert responses == [Response(accepted=False, answered=False, reason="service /mute does not answer for 20 s")]
    assert responses[0].failure == responses[0].reason
    assert Response(accepted=False, reason="on the ground").failure == "refused: on the ground"
    assert service.forgotten == [service.sent[0][1]]
    service.sent[0][1].finish(accepted=True, reason="", reference_id=1)
    assert len(responses) == 1
