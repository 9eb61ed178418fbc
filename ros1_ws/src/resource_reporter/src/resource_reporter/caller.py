"""A call of a service that never takes longer than it may: rospy's own has no time limit."""

from __future__ import annotations

import contextlib
import socket
import threading
from dataclasses import dataclass, field
from typing import Any

import rospy

CALL_LIMIT_S = 2.0
MOST_ABANDONED = 4


class CallFailedError(RuntimeError):
    """The service is not there, broke off, or did not answer in time."""


@dataclass
class _Attempt:
    """One call in a thread of its own, which may be abandoned."""

    done: threading.Event = field(default_factory=threading.Event)
    response: Any = None
    error: str = ""


class ServiceCaller:
    """Call a service over a kept connection (no look-up at the master: about 1 ms), renewed when it broke; from one thread at a time."""

    def __init__(self, name: str, kind: Any) -> None:
        self.name = name
        self._kind = kind
        self._proxy: rospy.ServiceProxy | None = None
        self._abandoned: list[threading.Thread] = []

    def call(self, request: Any, *, limit_s: float = CALL_LIMIT_S) -> Any:
        """Return the answer; CallFailedError after ``limit_s`` (wall clock) at the latest."""
        self._abandoned = [thread for thread in self._abandoned if thread.is_alive()]
        if len(self._abandoned) >= MOST_ABANDONED:
            self._abandoned[0].join(limit_s)
            raise CallFailedError(f"{self.name} does not answer")
        attempt = _Attempt()
        thread = threading.Thread(target=self._run, args=(request, attempt), daemon=True)
        thread.start()
        if not attempt.done.wait(limit_s):
            self.close()
            self._abandoned.append(thread)
            raise CallFailedError(f"{self.name} did not answer within {limit_s:.3g} s")
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

    def _run(self, request: Any, attempt: _Attempt) -> None:
        try:
            if self._proxy is None:
                self._proxy = rospy.ServiceProxy(self.name, self._kind, persistent=True)
            attempt.response = self._proxy(request)
        except Exception as error:  # noqa: BLE001  # rospy lets through all that the sockets below it raise
            attempt.error = f"{self.name}: {error}"
        finally:
            attempt.done.set()
