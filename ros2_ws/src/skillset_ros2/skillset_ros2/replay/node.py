"""What hooks need of an rclpy node, in virtual time, with the answers of a recorded flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from alula.common.plain import to_plain
from alula.runtime.local import Timer, VirtualClock

Subscribers = dict[str, list[Callable[[Any], None]]]


def absolute(name: str) -> str:
    """Return a name of a node without a namespace as the functional layer has it."""
    return f"/{name.lstrip('/')}"


class RecordedFuture:
    """An answer that comes, or does not."""

    def __init__(self) -> None:
        self._result: Any = None
        self._callbacks: list[Callable[[RecordedFuture], None]] = []

    def add_done_callback(self, callback: Callable[[RecordedFuture], None]) -> None:
        """Have a callback called when the answer comes."""
        self._callbacks.append(callback)

    def result(self) -> Any:
        """Return the recorded response; None before it was resolved."""
        return self._result

    def resolve(self, result: Any) -> None:
        """Set the response and call the callbacks, on this thread."""
        self._result = result
        for callback in self._callbacks:
            callback(self)


Answer = Callable[[str, Mapping[str, Any]], RecordedFuture]
"""What is called with a service's name and a request."""


class RecordedService:
    """A client of a service whose answers are recorded."""

    def __init__(self, name: str, answer: Answer) -> None:
        self.service_name = name
        self._answer = answer

    def service_is_ready(self) -> bool:
        """Return True: the record answers."""
        return True

    def wait_for_service(self, timeout_sec: float) -> bool:  # noqa: ARG002 - rclpy's signature
        """Tell that there is nothing to be stopped at the start: what ran before a record is not in it."""
        return False

    def call_async(self, request: Any) -> RecordedFuture:
        """Return a future of the recorded response to this request."""
        return self._answer(self.service_name, to_plain(request))

    def remove_pending_request(self, future: RecordedFuture) -> None:
        """Do nothing: no request is pending here."""


class BagNode:
    """What hooks use of an rclpy node, in virtual time, over a bag.

    Args:
        clock: the mission clock.
        answer: what answers calls of services.
        subscribers: the callbacks by topic, to which this node's are added.
        is_silent: whether the functional layer says nothing more, so that timers end.
        action: makes the client of an action's server.
    """

    def __init__(
        self, clock: VirtualClock, answer: Answer, subscribers: Subscribers, is_silent: Callable[[], bool], action: Callable[[str], Any]
    ) -> None:
        self._clock = clock
        self._answer = answer
        self._subscribers = subscribers
        self._is_silent = is_silent
        self._action = action

    def get_clock(self) -> BagNode:
        """Return the clock of the replay."""
        return self

    def now(self) -> SimpleNamespace:
        """Return the mission clock as rclpy does: with ``nanoseconds``."""
        return SimpleNamespace(nanoseconds=self._clock.now_ns)

    def create_timer(self, period_s: float, callback: Callable[[], None], **_: object) -> Timer:
        """Have a callback called again and again."""

        def again() -> None:
            if not self._is_silent():
                self._clock.after(period_s, again)
                callback()

        return self._clock.after(period_s, again)

    def create_client(self, _kind: object, name: str, **_: object) -> RecordedService:
        """Return a client that the record answers."""
        return RecordedService(absolute(name), self._answer)

    def destroy_client(self, client: RecordedService) -> None:
        """Do nothing: it is connected to nothing."""

    def create_action_client(self, _kind: object, name: str) -> Any:
        """Return a client that the record answers."""
        return self._action(absolute(name))

    def create_publisher(self, _kind: object, _topic: str, _depth: object, **_: object) -> SimpleNamespace:
        """Return what says something to nobody: what came of it then, the record tells."""
        return SimpleNamespace(publish=lambda _message: None)

    def create_subscription(self, _kind: object, topic: str, callback: Callable[[Any], None], *_: object, **__: object) -> None:
        """Have the callback called with each recorded message of a topic."""
        self._subscribers.setdefault(absolute(topic), []).append(callback)

    def declare_parameter(self, _name: str, value: object) -> SimpleNamespace:
        """Return a parameter with its default: a replay has no others."""
        return SimpleNamespace(value=value)
