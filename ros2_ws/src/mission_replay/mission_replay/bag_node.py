"""What the drone's hooks need of a node, in virtual time, with the answers of a recorded flight."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from skill_runtime.local import Timer, VirtualClock
from skill_runtime.plain import to_plain

if TYPE_CHECKING:
    from mission_replay.functional import RecordedFunctions


class RecordedFuture:
    """An answer that comes, or does not."""

    def __init__(self) -> None:
        self._result: Any = None
        self._callbacks: list[Callable[[RecordedFuture], None]] = []

    def add_done_callback(self, callback: Callable[[RecordedFuture], None]) -> None:
        """Have a callback called when the answer comes."""
        self._callbacks.append(callback)

    def result(self) -> Any:
        """Return the answer."""
        return self._result

    def resolve(self, result: Any) -> None:
        """Let the answer come."""
        self._result = result
        for callback in self._callbacks:
            callback(self)


class RecordedService:
    """A client of a service whose answers are recorded."""

    def __init__(self, answers: RecordedFunctions, name: str) -> None:
        self.srv_name = name
        self._answers = answers

    def service_is_ready(self) -> bool:
        """Tell that it is there."""
        return True

    def call_async(self, request: Any) -> RecordedFuture:
        """Call it."""
        return self._answers.called(self.srv_name, to_plain(request))

    def remove_pending_request(self, future: RecordedFuture) -> None:
        """Nothing waits here."""


class BagNode:
    """What the drone's hooks use of an rclpy node, in virtual time, over a bag."""

    def __init__(self, functions: RecordedFunctions) -> None:
        self._functions = functions
        self._clock: VirtualClock = functions.world.clock

    def get_clock(self) -> BagNode:
        """Return what tells the time."""
        return self

    def now(self) -> SimpleNamespace:
        """Return the mission clock."""
        return SimpleNamespace(nanoseconds=self._clock.now_ns)

    def create_timer(self, period_s: float, callback: Callable[[], None], **_: object) -> Timer:
        """Have a callback called again and again."""

        def again() -> None:
            if not self._functions.silent:
                self._clock.after(period_s, again)
                callback()

        return self._clock.after(period_s, again)

    def create_client(self, _kind: object, name: str, **_: object) -> RecordedService:
        """Connect to a service."""
        return RecordedService(self._functions, name)

    def create_subscription(self, _kind: object, topic: str, callback: Callable[[Any], None], *_: object, **__: object) -> None:
        """Follow a topic."""
        self._functions.subscribers.setdefault(topic, []).append(callback)

    def declare_parameter(self, _name: str, value: object) -> SimpleNamespace:
        """Return the parameter's default."""
        return SimpleNamespace(value=value)
