"""Service calls that neither block their caller nor last for ever; rospy's own have no time limit.

Time in which this process could not run does not count: the answer may wait to be read.

A rospy node's socket keeps five connections that were not accepted yet. The kernel drops what comes above that, and its sender asks again
after 1, 3 and 7 s. So no more than a window of calls of one service is under way at a time; the others wait for their turn.
"""

from __future__ import annotations

import contextlib
import math
import queue
import socket
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable
from typing import Any

import rospy

from alula.runtime.core.errors import SkillRuntimeError

DEFAULT_TIMEOUT_S = 2.0
AGAIN_S = 0.1
LOOK_S = 0.25
WINDOW = 4
"""So many calls of a service are under way at a time, from one process; topics' connections come to the same socket."""
OnReply = Callable[[Any], None]
OnError = Callable[[str], None]


class ServiceCallError(SkillRuntimeError):
    """A service was not there, or did not answer in time."""


class _Call:
    """One call on a thread of its own; what closes it first, answer or deadline, decides."""

    def __init__(self, name: str, kind: Any, request: Any, timeout_s: float) -> None:
        self.name, self.timeout_s = name, timeout_s
        self._kind, self._request = kind, request
        self.made_s = time.monotonic()
        self._proxy: Any = None
        self._over = threading.Event()
        self._answer: queue.SimpleQueue[tuple[Any, str]] = queue.SimpleQueue()

    def run(self, from_s: float) -> tuple[Any, str]:
        """Return the reply, or None and why there is none; within the time limit, which is counted from a time (`time.monotonic`)."""
        now_s = time.monotonic()
        left_s = from_s + self.timeout_s - now_s
        if left_s > 0.0:
            threading.Thread(target=self._try, name=f"call_{self.name}", daemon=True).start()
        try:
            while left_s > 0.0:
                with contextlib.suppress(queue.Empty):
                    return self._answer.get(timeout=min(left_s, LOOK_S))
                before_s, now_s = now_s, time.monotonic()
                left_s -= min(now_s - before_s, 2.0 * LOOK_S)
            why = "is not there" if self._proxy is not None and not self._sent else "did not answer"
            return None, f"service {self.name} {why} within {self.timeout_s:g} s"
        finally:
            self._over.set()
            self._break_off()

    @property
    def _sent(self) -> bool:
        return self._proxy.transport is not None

    def _try(self) -> None:
        """Call, again while the service is not there yet."""
        while not self._over.is_set():
            self._proxy = rospy.ServiceProxy(self.name, self._kind, persistent=True)
            try:
                reply = self._proxy(self._request)
            except Exception as error:  # noqa: BLE001 - rospy lets through whatever the sockets below it raise
                if self._sent or rospy.is_shutdown():
                    self._answer.put((None, f"service {self.name} broke off: {error}"))
                    return
            else:
                self._answer.put((reply, ""))
                return
            self._over.wait(AGAIN_S)

    def _break_off(self) -> None:
        """Free a thread that still waits for an answer."""
        transport = self._proxy.transport if self._proxy is not None else None
        if transport is not None and transport.socket is not None:
            with contextlib.suppress(OSError):
                transport.socket.shutdown(socket.SHUT_RDWR)
            transport.close()


def call_and_wait(name: str, kind: Any, request: Any, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
    """Call a service as soon as it is available, and wait for its reply.

    Raises:
        ServiceCallError: there is none within the time (wall clock).
    """
    reply, error = _Call(name, kind, request, timeout_s).run(time.monotonic())
    if error:
        raise ServiceCallError(error)
    return reply


class _Queue:
    """The calls of one service from this process, in order, a window of them at a time.

    The time of a call begins with the last answer before its turn, so that it is not counted how many came before; where the service has
    answered none since the call was made, with the call.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: deque[tuple[_Call, OnReply, OnError]] = deque()
        self._under_way = 0
        self._answered_s = -math.inf

    def put(self, call: _Call, on_reply: OnReply, on_error: OnError) -> None:
        """Make a call when its turn comes."""
        with self._lock:
            self._waiting.append((call, on_reply, on_error))
        self._begin()

    def _begin(self) -> None:
        with self._lock:
            if not self._waiting or self._under_way >= WINDOW:
                return
            call, on_reply, on_error = self._waiting.popleft()
            self._under_way += 1
        threading.Thread(target=self._run, args=(call, on_reply, on_error), name=f"reply_{call.name}", daemon=True).start()

    def _run(self, call: _Call, on_reply: OnReply, on_error: OnError) -> None:
        reply, error = call.run(max(call.made_s, self._answered_s))
        with self._lock:
            self._under_way -= 1
            self._answered_s = self._answered_s if error else time.monotonic()
        self._begin()  # before the callbacks, which may take their time
        if error:
            on_error(error)
            return
        try:
            on_reply(reply)
        except Exception as problem:  # noqa: BLE001 - told, and the hook's to deal with
            on_error(f"{call.name}: {type(problem).__name__}: {problem}")


_queues: defaultdict[str, _Queue] = defaultdict(_Queue)


def call(name: str, kind: Any, request: Any, on_reply: OnReply, on_error: OnError, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
    """Call a service; return at once. Then either ``on_reply`` or ``on_error`` is called, on another thread, in time.

    ``on_error`` is also called when ``on_reply`` raises, so ``on_error=execution.fail`` ends the execution whatever goes wrong. Calls of
    one service are queued; while the service answers, the time limit of each counts from its turn.
    """
    _queues[rospy.resolve_name(name)].put(_Call(name, kind, request, timeout_s), on_reply, on_error)
