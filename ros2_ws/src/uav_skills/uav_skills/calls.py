"""Service calls to the functional layer that never block, arrive in order, and always get a response.

The functional layer lives in another world behind the bridge: a service may be away for a moment, and two services are
served by different threads. So calls wait in one queue, and the next is sent when the last got its response, or when it was sent
long enough ago to have arrived: a response may take seconds (the guidance arms the vehicle first), and a call that stops the
vehicle must not wait for it. A call without a response in time gets one from here, that is no refusal: nobody knows whether it arrived.

What is waited for passes through discovery and the bridge, which know wall clock; simulated time does not wait for it in lockstep, and
may run ahead. So all three limits count one clock, the slower one of mission and monotonic clock: on a robot those are one, a slow machine
refuses nothing, and a fast simulation waits for more of its own seconds. That makes a run longer, and a service that is away is missed
later in it; who hears its response in time sees no difference.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

ARRIVED_AFTER_S = 0.3
RESPONSE_TIMEOUT_S = 20.0
SERVER_TIMEOUT_S = 3.0


@dataclass(frozen=True)
class Response:
    """A service's response; ``reference_id`` is 0 where the service has none or refused. ``answered``: it is the service's own."""

    accepted: bool
    reason: str = ""
    reference_id: int = 0
    answered: bool = True

    @property
    def failure(self) -> str:
        """Say why the request is not followed: the service's words, as a refusal, or that it gave none."""
        return f"refused: {self.reason}" if self.answered else self.reason


Reply = Callable[[Response], None]


class Service(Protocol):
    """What is needed of an rclpy service client."""

    service_name: str

    def service_is_ready(self) -> bool:
        """Return whether a server is there."""
        ...

    def call_async(self, request: Any) -> Any:
        """Send the request, return a future."""
        ...

    def remove_pending_request(self, future: Any) -> None:
        """Forget a request whose response does not matter any more."""
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
        return now_s - self.turn_s > SERVER_TIMEOUT_S if self.sent_s is None else now_s - self.sent_s > RESPONSE_TIMEOUT_S

    def holds_back(self, now_s: float) -> bool:
        return self.sent_s is None or now_s - self.sent_s < ARRIVED_AFTER_S

    def unanswered(self) -> Response:
        missing = f"is not there for {SERVER_TIMEOUT_S:g} s" if self.sent_s is None else f"does not answer for {RESPONSE_TIMEOUT_S:g} s"
        return Response(accepted=False, answered=False, reason=f"service {self.service.service_name} {missing}")


def ignore_response(_response: Response) -> None:
    """Ignore a response that changes nothing."""


def read_response(response: Any) -> Response:
    """Read a response of uav_msgs (accepted, reason) or of std_srvs (success, message)."""
    if hasattr(response, "accepted"):
        return Response(bool(response.accepted), str(response.reason), int(getattr(response, "reference_id", 0)))
    return Response(bool(response.success), str(response.message))


class CallQueue:
    """Sends calls in order; thread-safe. ``now_s``: the slower clock. ``tick`` it several times a second while any call is ``pending``."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._calls: list[_Call] = []
        self._lock = threading.Lock()

    @property
    def pending(self) -> bool:
        """Whether any call is without a response."""
        return bool(self._calls)

    def submit(self, service: Service, request: object, reply: Reply = ignore_response) -> None:
        """Send the request when its turn comes; ``reply`` gets exactly one response, from another thread or this one."""
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
            call.reply(call.unanswered())
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
        # rclpy calls this in a thread of its executor, or here when the response is there already.
        call.future.add_done_callback(lambda future: self._on_reply(call, future))

    def _on_reply(self, call: _Call, future: Any) -> None:
        with self._lock:
            if call not in self._calls:
                return  # it was too late
            self._calls.remove(call)
        call.reply(read_response(future.result()))
        self.tick()
