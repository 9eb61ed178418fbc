"""Service calls that neither block their caller nor last for ever; rospy's own have no time limit."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy

from alula.runtime.core.errors import SkillRuntimeError

DEFAULT_TIMEOUT_S = 2.0
AGAIN_S = 0.1
OnReply = Callable[[Any], None]
OnError = Callable[[str], None]


class ServiceCallError(SkillRuntimeError):
    """A service was not there, or did not answer in time."""


class _Call:
    """One call on a thread of its own; what closes it first, answer or deadline, decides."""

    def __init__(self, name: str, kind: Any, request: Any, timeout_s: float) -> None:
        self._name, self._kind, self._request, self._timeout_s = name, kind, request, timeout_s
        self._deadline_s = time.monotonic() + timeout_s
        self._proxy: Any = None
        self._over = threading.Event()
        self._answer: queue.SimpleQueue[tuple[Any, str]] = queue.SimpleQueue()

    def run(self) -> tuple[Any, str]:
        """Return the reply, or None and why there is none; within the time limit."""
        threading.Thread(target=self._try, name=f"call_{self._name}", daemon=True).start()
        try:
            return self._answer.get(timeout=self._timeout_s)
        except queue.Empty:
            return None, f"service {self._name} did not answer within {self._timeout_s:g} s"
        finally:
            self._over.set()
            self._break_off()

    def _try(self) -> None:
        """Call, again while the service is not there yet."""
        while not self._over.is_set():
            self._proxy = rospy.ServiceProxy(self._name, self._kind, persistent=True)
            try:
                reply = self._proxy(self._request)
            except Exception as error:  # noqa: BLE001 - rospy lets through whatever the sockets below it raise
                if self._is_last(error):
                    return
            else:
                self._answer.put((reply, ""))
                return
            self._over.wait(AGAIN_S)

    def _is_last(self, error: Exception) -> bool:
        """Tell whether a failed attempt was the last one, and then the caller why it failed."""
        sent = self._proxy.transport is not None
        late = time.monotonic() + AGAIN_S > self._deadline_s
        if not (sent or late or rospy.is_shutdown()):
            return False
        what = f"broke off: {error}" if sent else f"is not there within {self._timeout_s:g} s"
        self._answer.put((None, f"service {self._name} {what}"))
        return True

    def _break_off(self) -> None:
        """Free a thread that still waits for an answer."""
        transport = self._proxy.transport if self._proxy is not None else None
        if transport is not None and transport.socket is not None:
            with contextlib.suppress(OSError):
                transport.socket.shutdown(socket.SHUT_RDWR)
            transport.close()


def call_and_wait(name: str, kind: Any, request: Any, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> Any:
    """Return the reply of a service, called as soon as it is there.

    Raises:
        ServiceCallError: there is none within the time (wall clock).
    """
    reply, error = _Call(name, kind, request, timeout_s).run()
    if error:
        raise ServiceCallError(error)
    return reply


def call(name: str, kind: Any, request: Any, on_reply: OnReply, on_error: OnError, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
    """Call a service; return at once. Then either ``on_reply`` or ``on_error`` is called, on another thread, in time.

    ``on_error`` is also called when ``on_reply`` raises, so ``on_error=execution.fail`` ends the execution whatever goes wrong.
    """

    def run() -> None:
        reply, error = _Call(name, kind, request, timeout_s).run()
        if error:
            on_error(error)
            return
        try:
            on_reply(reply)
        except Exception as problem:  # noqa: BLE001 - told, and the hook's to deal with
            on_error(f"{name}: {type(problem).__name__}: {problem}")

    threading.Thread(target=run, name=f"reply_{name}", daemon=True).start()
