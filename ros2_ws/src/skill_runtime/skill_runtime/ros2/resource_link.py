"""A skill manager's end of the link to the resource manager in another process."""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from skill_runtime.ros2.link import GONE, Body, LinkEnd

HELLO_S = 0.2
REPLY_S = 10.0
"""Who has no reply for so long (wall clock) takes it for a no; a resource manager that is gone is noticed before."""
ANEW = "its process was started anew"


class LinkUser(Protocol):
    """What the end needs of the skill manager; called on the link's thread, must not wait."""

    def on_call(self, number: str, body: dict[str, Any]) -> None:
        """Call a hook."""
        ...

    def on_told(self, execution_id: str, body: dict[str, Any]) -> None:
        """Take an event of an execution."""
        ...

    def on_gone(self, reason: str) -> None:
        """End everything: the resource manager knows nothing of it any more."""
        ...


class ResourceLink:
    """Says hello until it is welcome, and anew when the resource manager has gone."""

    def __init__(self, node: Node, skillset: str, skill: str, user: LinkUser, on_welcome: Callable[[], None]) -> None:
        self._name = f"the resource manager of {skillset}"
        self._user = user
        self._on_welcome = on_welcome
        self._manager = ""
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._replies: dict[str, Callable[[object], None]] = {}
        place = f"{skillset}/managers/{skill}"
        self._end = LinkEnd(node, to=f"{place}/requests", of=f"{place}/calls", on_message=self._hear, on_gone=lambda: self._lose(GONE))
        self._timer: Any = node.create_timer(HELLO_S, self._say_hello, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def connected(self) -> bool:
        """Tell whether the resource manager is there."""
        return bool(self._manager)

    def send(self, kind: str, identifier: str, body: Body | None = None) -> bool:
        """Say something that has no reply; False when nobody is there to hear it."""
        manager = self._manager
        if manager:
            self._end.send(manager, kind, identifier, body)
        return bool(manager)

    def ask(self, kind: str, body: Body) -> bool:
        """Ask for something and wait for the reply, never on the link's own thread; False when nobody gives one."""
        number, replied = str(next(self._numbers)), threading.Event()
        values: list[object] = []

        def reply(value: object) -> None:
            values.append(value)
            replied.set()

        with self._lock:
            if not self._manager:
                return False
            self._replies[number] = reply
        self.send(kind, number, body)
        replied.wait(REPLY_S)
        with self._lock:
            self._replies.pop(number, None)
        return bool(values and values[0])

    def _say_hello(self) -> None:
        self._end.send("", "hello")

    def _hear(self, message: Any) -> None:
        if message.kind == "welcome":
            self._be_welcome(message.sender)
        elif message.kind == "stranger":
            self._lose(ANEW)
        elif message.sender == self._manager:
            self._end.trust()
            self._take(message.kind, message.id, json.loads(message.body_json))

    def _take(self, kind: str, identifier: str, body: dict[str, Any]) -> None:
        match kind:
            case "call":
                self._user.on_call(identifier, body)
            case "event":
                self._user.on_told(identifier, body)
            case "reply":
                with self._lock:
                    reply = self._replies.pop(identifier, None)
                if reply is not None:
                    reply(body["value"])

    def _be_welcome(self, manager: str) -> None:
        if self._manager and self._manager != manager:
            self._lose(ANEW)
        with self._lock:
            self._manager = manager
        self._end.trust()
        self._timer.cancel()
        self._on_welcome()

    def _lose(self, reason: str) -> None:
        with self._lock:
            known, self._manager = self._manager, ""
            replies, self._replies = self._replies, {}
        self._timer.reset()
        if known:
            for reply in replies.values():
                reply(False)
            self._user.on_gone(f"{self._name} has gone: {reason}")
