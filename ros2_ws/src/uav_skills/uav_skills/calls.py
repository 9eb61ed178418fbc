"""Service calls to the functional layer that never block, arrive in order, and always get an answer.

The functional layer lives in another world behind the bridge: a service may be away for a moment, and two services are
served by different threads. So calls wait in one queue, and the next is sent when the last was answered, or when it was sent
long enough ago to have arrived: an answer may take seconds (the guidance arms the vehicle first), and a call that stops the
vehicle must not wait for it. What is not answered in time is answered here, as a refusal that says so.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

ARRIVED_AFTER_S = 0.3
ANSWERED_WITHIN_S = 20.0
THERE_WITHIN_S = 3.0


@dataclass(frozen=True)
class Answer:
    """What a service said; ``reference_id`` is 0 where the service has none or refused."""

    accepted: bool
    reason: str = ""
    reference_id: int = 0


Reply = Callable[[Answer], None]


class Service(Protocol):
    """What is needed of an rclpy service client."""

    srv_name: str

    def service_is_ready(self) -> bool:
        """Tell whether a server is there."""
        ...

    def call_async(self, request: Any) -> Any:
        """Send the request, return a future."""
        ...

    def remove_pending_request(self, future: Any) -> None:
        """Forget a request whose answer does not matter any more."""
        ...


@dataclass(eq=False)
class _Call:
    service: Service
    request: object
    reply: Reply
    turn_s: float  # since when nothing before it holds it back
    sent_s: float | None = None
    future: Any = None

    def overdue(self, now_s: float) -> bool:
        return now_s - self.turn_s > THERE_WITHIN_S if self.sent_s is None else now_s - self.sent_s > ANSWERED_WITHIN_S

    def holds_back(self, now_s: float) -> bool:
        return self.sent_s is None or now_s - self.sent_s < ARRIVED_AFTER_S

    def refusal(self) -> Answer:
        name = self.service.srv_name
        if self.sent_s is None:
            return Answer(accepted=False, reason=f"service {name} is not there for {THERE_WITHIN_S:g} s")
        return Answer(accepted=False, reason=f"service {name} does not answer for {ANSWERED_WITHIN_S:g} s")


def ignore_answer(_answer: Answer) -> None:
    """Take an answer that changes nothing."""


def read_answer(response: Any) -> Answer:
    """Read an answer of uav_msgs (accepted, reason) or of std_srvs (success, message)."""
    if hasattr(response, "accepted"):
        return Answer(bool(response.accepted), str(response.reason), int(getattr(response, "reference_id", 0)))
    return Answer(bool(response.success), str(response.message))


class CallQueue:
    """Sends calls in order; thread-safe. ``now_s``: mission clock. ``tick`` is to be called several times a second of it."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._calls: list[_Call] = []
        self._lock = threading.Lock()

    def submit(self, service: Service, request: object, reply: Reply = ignore_answer) -> None:
        """Send the request when its turn comes; ``reply`` gets exactly one answer, from another thread or this one."""
        with self._lock:
            self._calls.append(_Call(service, request, reply, self._now_s()))
        self.tick()

    def tick(self) -> None:
        """Answer what waited for too long, and send what can be sent now."""
        now_s = self._now_s()
        with self._lock:
            overdue = [call for call in self._calls if call.overdue(now_s)]
            self._calls = [call for call in self._calls if call not in overdue]
            sent = self._send(now_s)
        for call in overdue:
            if call.future is not None:
                call.service.remove_pending_request(call.future)
            call.reply(call.refusal())
        for call in sent:
            self._follow(call)

    def _send(self, now_s: float) -> list[_Call]:
        sent: list[_Call] = []
        held_back = False
        for call in self._calls:
            if held_back:
                call.turn_s = now_s
            elif call.sent_s is None and call.service.service_is_ready():
                call.sent_s = now_s
                call.future = call.service.call_async(call.request)
                sent.append(call)
            held_back = held_back or call.holds_back(now_s)
        return sent

    def _follow(self, call: _Call) -> None:
        # rclpy calls this in a thread of its executor, or here when the answer is there already.
        call.future.add_done_callback(lambda future: self._answered(call, future))

    def _answered(self, call: _Call, future: Any) -> None:
        with self._lock:
            if call not in self._calls:
                return  # it was too late
            self._calls.remove(call)
        call.reply(read_answer(future.result()))
        self.tick()
