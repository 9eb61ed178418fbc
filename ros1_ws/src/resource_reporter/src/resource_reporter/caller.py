"""A call of the transition service that never takes longer than it may: rospy's own has no time limit."""

from __future__ import annotations

import contextlib
import socket
import threading
from dataclasses import dataclass, field

import rospy
from skillset_interfaces.srv import Transition, TransitionResponse

from resource_reporter.ledger import Call

CALL_LIMIT_S = 2.0
MOST_ABANDONED = 4


class CallFailedError(RuntimeError):
    """The service is not there, broke off, or did not answer in time."""


@dataclass
class _Attempt:
    """One call in a thread of its own, which may be abandoned."""

    done: threading.Event = field(default_factory=threading.Event)
    response: TransitionResponse | None = None
    error: str = ""


class TransitionCaller:
    """Call ``/<skillset>/transition`` over a kept connection (no look-up at the master: about 1 ms), renewed when it broke."""

    def __init__(self, skillset: str) -> None:
        self._name = f"/{skillset}/transition"
        self._proxy: rospy.ServiceProxy | None = None
        self._abandoned: list[threading.Thread] = []

    def call(self, call: Call) -> TransitionResponse:
        """Ask for a transition; CallFailedError after 2 s at the latest."""
        self._abandoned = [thread for thread in self._abandoned if thread.is_alive()]
        if len(self._abandoned) >= MOST_ABANDONED:
            self._abandoned[0].join(CALL_LIMIT_S)
            raise CallFailedError(f"{self._name} does not answer")
        attempt = _Attempt()
        thread = threading.Thread(target=self._run, args=(call, attempt), daemon=True)
        thread.start()
        if not attempt.done.wait(CALL_LIMIT_S):
            self.close()
            self._abandoned.append(thread)
            raise CallFailedError(f"{self._name} did not answer within {CALL_LIMIT_S} s")
        if attempt.response is None:
            self.close()
            raise CallFailedError(attempt.error)
        return attempt.response

    def close(self) -> None:
        """Drop the connection; a thread that waits on it ends."""
        proxy, self._proxy = self._proxy, None
        transport = proxy.transport if proxy is not None else None
        if transport is not None and transport.socket is not None:
            with contextlib.suppress(OSError):
                transport.socket.shutdown(socket.SHUT_RDWR)
            transport.close()

    def _run(self, call: Call, attempt: _Attempt) -> None:
        if self._proxy is None:
            self._proxy = rospy.ServiceProxy(self._name, Transition, persistent=True)
        try:
            attempt.response = self._proxy(call.resource, call.to, call.reason)
        except Exception as error:  # noqa: BLE001  # rospy lets through all that the sockets below it raise
            attempt.error = f"{self._name}: {error}"
        finally:
            attempt.done.set()
