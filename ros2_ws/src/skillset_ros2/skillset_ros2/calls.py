"""Calls of one service that end, whatever DDS loses.

A DDS service may answer before it has discovered the client: the answer is lost (rclpy 7.1.6 then warns of a "client [that] will not
receive response"). And a burst of requests that is longer than the queue at its end is cut. So no more than a window of requests is
under way at a time, each is asked again after a while without an answer, and given up after its time. Time in which this process could
not run does not count: answers may wait for it. The graph does not tell of every end that is there (rmw_fastrtps, issue 792): after a
while without being told of a service, one request is sent all the same.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from alula.runtime.middleware import OnError, OnReply
from alula.runtime.timers import Job, Timer

AGAIN_S = 1.0
"""An answer that has not come for so long (wall clock) is taken for lost."""
WINDOW = 50
"""So many requests are under way at a time; the others wait."""
QUEUE = 10_000
"""So many may wait; one more is refused at once."""
LOOK_S = 0.25
UNSEEN_S = 3.0
"""So long (wall clock) the graph may take to tell of an end that is there."""
Later = Callable[[float, Job], Timer]
Withdraw = Callable[[], object]


@dataclass(eq=False)
class _Call:
    request: Any
    on_reply: OnReply
    on_error: OnError
    timeout_s: float
    once: bool
    begun_s: float
    asked_s: float = 0.0
    tries: int = 0
    unseen: bool = False
    over: bool = False


class Discovery:
    """Tells whether the graph knows of an end, or has had time enough to; asked again and again while that matters."""

    def __init__(self, told: Callable[[], bool]) -> None:
        self._told = told
        self._since_s: float | None = None

    def __call__(self) -> bool:
        """Return whether the end may be taken for connected."""
        if self._told():
            self._since_s = None
            return True
        now_s = time.monotonic()
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s > UNSEEN_S


class Calls:
    """The calls of one service; from any thread.

    Args:
        client: rclpy's.
        later: runs a job after a delay of wall clock.
        awaits: has the executor wait for the client, or not: it rests while nothing is awaited of it.
    """

    def __init__(self, client: Any, later: Later, awaits: Callable[[bool], None]) -> None:
        self._client = client
        self._later = later
        self._await = awaits
        self._lock = threading.Lock()
        self._waiting: deque[_Call] = deque()
        self._open: list[_Call] = []
        self._looking = False
        self._look_at_s = 0.0
        self._closed = False
        self._met_unseen = False
        """The service answers although the graph does not tell of it."""

    @property
    def ready(self) -> bool:
        """Return whether the service is served."""
        return not self._closed and (self._met_unseen or bool(self._client.service_is_ready()))

    def call(self, request: Any, on_reply: OnReply, on_error: OnError, *, timeout_s: float, once: bool) -> Withdraw:
        """Ask; either ``on_reply`` or ``on_error`` is called, once. The return value ends that: nothing is asked again or told."""
        call = _Call(request, on_reply, on_error, timeout_s, once, time.monotonic())
        with self._lock:
            closed = self._closed
            full = len(self._waiting) >= QUEUE
            if not (closed or full):
                self._waiting.append(call)
        if closed or full:
            why = "this client was closed" if closed else f"{QUEUE} requests wait for it already"
            on_error(f"service {self._client.srv_name}: {why}")
        else:
            self._pump()
            self._look_later()
        return lambda: self._close(call)

    def close(self) -> None:
        """Send no more; calls under way end with an error."""
        with self._lock:
            self._closed = True
            calls = [*self._waiting, *self._open]
        for call in calls:
            if self._close(call):
                call.on_error(f"service {self._client.srv_name}: this client was closed")

    # --- inside ------------------------------------------------------------------------------------------------------

    def _pump(self) -> None:
        """Send what the window lets through."""
        while self.ready:
            with self._lock:
                if not self._waiting or len(self._open) >= WINDOW:
                    return
                call = self._waiting.popleft()
                self._open.append(call)
            self._send(call)

    def _send(self, call: _Call) -> None:
        call.asked_s = time.monotonic()
        call.begun_s = call.begun_s if call.tries or call.unseen else call.asked_s
        call.tries += 1
        future = self._client.call_async(call.request)
        # With no executor, the callback is called where the answer is taken, not a turn of the executor later.
        future._set_executor = _ignore  # noqa: SLF001 - rclpy 7.1.6 has no other way
        self._await(True)
        future.add_done_callback(lambda future: self._take(call, future))

    def _take(self, call: _Call, future: Any) -> None:
        response = future.result()
        if response is not None and call.unseen:
            self._met_unseen = True
        if response is not None and self._close(call):
            call.on_reply(response, call.tries)
        self._pump()

    def _close(self, call: _Call) -> bool:
        """Take a call off the list; False when it was closed before."""
        with self._lock:
            first, call.over = not call.over, True
            if call in self._open:
                self._open.remove(call)
            elif call in self._waiting:
                self._waiting.remove(call)
            if not self._open:
                self._await(False)
        return first

    def _look_later(self) -> None:
        with self._lock:
            if self._looking or not (self._open or self._waiting):
                return
            self._looking = True
            self._look_at_s = time.monotonic() + LOOK_S
        self._later(LOOK_S, self._look)

    def _look(self) -> None:
        """Ask again, and give up what is too late."""
        with self._lock:
            self._looking = False
            calls, waiting = list(self._open), list(self._waiting)
            now_s = time.monotonic()
            late_s = now_s - self._look_at_s
            if late_s > LOOK_S:
                for call in (*calls, *waiting):
                    call.begun_s, call.asked_s = min(call.begun_s + late_s, now_s), min(call.asked_s + late_s, now_s)
        if any(now_s - call.asked_s > AGAIN_S for call in calls):
            self._met_unseen = False  # it may have gone: what waits must wait for the next one
        for call in calls:
            if now_s - call.begun_s > call.timeout_s:
                self._give_up(call, "did not answer")
            elif not call.once and now_s - call.asked_s > AGAIN_S and (call.unseen or self.ready):
                self._send(call)
        if waiting and not self.ready:
            for call in waiting:
                if now_s - call.begun_s > call.timeout_s:
                    self._give_up(call, "is not there")
            self._send_unseen(now_s)
        self._pump()
        self._look_later()

    def _send_unseen(self, now_s: float) -> None:
        """Send one request that has waited long enough to a service that the graph does not tell of."""
        with self._lock:
            if self._open or self._closed or not self._waiting or now_s - self._waiting[0].begun_s <= UNSEEN_S:
                return
            call = self._waiting.popleft()
            call.unseen = True
            self._open.append(call)
        self._send(call)

    def _give_up(self, call: _Call, why: str) -> None:
        if self._close(call):
            call.on_error(f"service {self._client.srv_name} {why} within {call.timeout_s:g} s")


def _ignore(executor: object) -> None:
    """Have a future's callbacks called at once."""
