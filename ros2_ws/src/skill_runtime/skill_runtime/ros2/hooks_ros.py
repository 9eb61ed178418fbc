"""What hooks need to speak with the functional layer: service calls that neither block nor last for ever."""

from __future__ import annotations

import queue
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from skill_runtime.core.errors import SkillRuntimeError

DEFAULT_TIMEOUT_S = 2.0
_TICK_S = 0.05
_PATIENCE_S = 1.0
OnReply = Callable[[Any], None]
OnError = Callable[[str], None]


class ServiceCallError(SkillRuntimeError):
    """A service was not there, or did not answer in time."""


@dataclass(eq=False)
class _Call:
    client: Any
    request: Any
    on_reply: OnReply
    on_error: OnError
    timeout_s: float
    deadline_s: float
    future: Any = None
    over: bool = False


class ServiceCaller:
    """Calls services for all hooks of a node. Time is steady, not the mission clock: that may stand still."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._lock = threading.Lock()
        self._calls: list[_Call] = []
        self._timer = node.create_timer(_TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)

    def call(self, client: Any, request: Any, on_reply: OnReply, on_error: OnError, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        """Send a request, as soon as the service is there; then either ``on_reply`` or ``on_error`` is called, once.

        ``on_error`` is also called with the last line of the traceback when ``on_reply`` raises, so
        ``on_error=execution.fail`` ends the execution whatever goes wrong.
        """
        call = _Call(client, request, on_reply, on_error, timeout_s, time.monotonic() + timeout_s)
        with self._lock:
            self._calls.append(call)
        self._send(call)
        self._timer.reset()

    def call_and_wait(self, client: Any, request: Any, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
        """Return the reply; for ``validate`` only, whose thread may wait.

        Raises:
            ServiceCallError: there is none within the time.
        """
        answer: queue.SimpleQueue[tuple[Any, str]] = queue.SimpleQueue()
        self.call(client, request, lambda reply: answer.put((reply, "")), lambda error: answer.put((None, error)), timeout_s=timeout_s)
        try:
            reply, error = answer.get(timeout=timeout_s + _PATIENCE_S)
        except queue.Empty:
            raise ServiceCallError(f"{client.srv_name}: the node is not spun") from None
        if error:
            raise ServiceCallError(error)
        return reply

    def _send(self, call: _Call) -> None:
        if call.client.service_is_ready():
            call.future = call.client.call_async(call.request)
            call.future.add_done_callback(lambda future: self._on_done(call, future))

    def _on_done(self, call: _Call, future: Any) -> None:
        if not self._close(call):
            return
        try:
            call.on_reply(future.result())
        except Exception as error:  # noqa: BLE001 - whatever it is, it must not end the executor
            call.on_error(f"{call.client.srv_name}: {''.join(traceback.format_exception_only(error)).strip()}")

    def _close(self, call: _Call) -> bool:
        """Take a call off the list; False when it was closed before."""
        with self._lock:
            if call.over:
                return False
            call.over = True
            self._calls.remove(call)
            return True

    def _tick(self) -> None:
        with self._lock:
            calls = list(self._calls)
            if not calls:
                self._timer.cancel()
        for call in calls:
            if call.future is None and not call.over:
                self._send(call)
            if time.monotonic() > call.deadline_s and self._close(call):
                if call.future is not None:
                    call.client.remove_pending_request(call.future)
                what = "is not there" if call.future is None else "did not answer"
                call.on_error(f"service {call.client.srv_name} {what} within {call.timeout_s:g} s")


class RosHooks:
    """Mixin for hooks: ``class Takeoff(AbstractTakeoffSkill, RosHooks)``; one ``ServiceCaller`` may serve many hooks."""

    caller: ServiceCaller

    def call(self, client: Any, request: Any, on_reply: OnReply, on_error: OnError, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        """Call a service; see ``ServiceCaller.call``."""
        self.caller.call(client, request, on_reply, on_error, timeout_s=timeout_s)

    def call_and_wait(self, client: Any, request: Any, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
        """Call a service and wait; see ``ServiceCaller.call_and_wait``."""
        return self.caller.call_and_wait(client, request, timeout_s=timeout_s)
