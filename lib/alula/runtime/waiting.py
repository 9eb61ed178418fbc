"""Things that end once, such as answers; a caller waits by blocking, by ``await`` (asyncio or rclpy), or by a callback."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from alula.runtime.core.errors import SkillRuntimeError

if TYPE_CHECKING:
    from typing import Self  # of Python 3.11

T = TypeVar("T")


class NoResponseError(SkillRuntimeError):
    """The managers gave no response within the time of a request, or have gone."""


class CannotWaitError(SkillRuntimeError):
    """A wait that could never end on this thread; the message says what to do instead."""


class Waiter(Protocol):
    """Blocks a thread until an event that the client's middleware brings."""

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait for the event; None: until it comes or can't come any more.

        Raises:
            CannotWaitError: this thread is the one that would have to bring the event, or no events are brought any more.
        """
        ...


class ThreadWaiter:
    """Blocks until another thread sets the event."""

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait on the wall clock; tell whether the event came within the time."""
        return event.wait(timeout_s)


class Waitable:
    """Ends once. All of it may be used from any thread."""

    def __init__(self, waiter: Waiter | None = None) -> None:
        self._waiter: Waiter = ThreadWaiter() if waiter is None else waiter
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._after: list[Callable[[], None]] = []

    def wait(self, timeout_s: float) -> bool:
        """Wait for the end; tell whether it came within the time (wall clock; mission clock where there is no middleware).

        Over rclpy, the node is spun when it has no executor; without middleware, the world runs.

        Raises:
            CannotWaitError: this thread is the one that would bring the end: ``await`` it there, or give it a callback.
        """
        return self._ended.is_set() or self._waiter.wait(self._ended, timeout_s)

    def call_at_end(self, action: Callable[[], None]) -> None:
        """Call ``action()`` once at the end, on the thread that brings it; at once when it is there."""
        with self._lock:
            if not self._ended.is_set():
                self._after.append(action)
                return
        action()

    def ending(self) -> Generator[object, None, None]:
        """Suspend a coroutine until the end, in asyncio as in an rclpy executor."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            # An rclpy executor (7.1.6) resumes its coroutines at each turn, whatever they yield.
            while not self._ended.is_set():
                yield None
            return
        arrival: asyncio.Future[None] = loop.create_future()

        def arrive() -> None:
            if not arrival.done():
                arrival.set_result(None)

        def tell() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(arrive)

        self.call_at_end(tell)
        try:
            yield from arrival
        finally:
            with self._lock:
                if tell in self._after:
                    self._after.remove(tell)

    def _end(self) -> None:
        """Wake all waiting threads; called once."""
        with self._lock:
            self._ended.set()
            after, self._after = self._after, []
        for action in after:
            action()


class Moment(Waitable):
    """A moment that comes when it is told."""

    def come(self) -> None:
        """End the wait of all who wait for this moment."""
        self._end()

    def wait_for_it(self) -> None:
        """Wait until it comes; raise CannotWaitError when it can't come (any more)."""
        if not self._ended.is_set():
            self._waiter.wait(self._ended, None)

    def __await__(self) -> Generator[object, None, None]:
        yield from self.ending()


class Pending(Waitable, Generic[T]):
    """An answer that is under way. It comes, or fails within the time that its question was given."""

    def __init__(self, waiter: Waiter | None = None) -> None:
        super().__init__(waiter)
        self._settled = False
        self._value: T | None = None
        self._failure = ""

    @property
    def done(self) -> bool:
        """Return whether the answer, or the reason why there is none, is here."""
        return self._ended.is_set()

    @property
    def failure(self) -> str:
        """Why there is no response; empty while it may still come, and when it has."""
        return self._failure

    @property
    def value(self) -> T:
        """Return the answer.

        Raises:
            NoResponseError: there is none, or not yet.
        """
        if not self.done or self._failure:
            raise NoResponseError(self._failure or "the response is still under way; wait for it or await it")
        return self._value  # type: ignore[return-value]  # set by `resolve`, before the end

    def get(self, timeout_s: float) -> T:
        """Wait for the answer and return it; raise as ``wait`` and ``value`` do."""
        self.wait(timeout_s)
        return self.value

    def add_done_callback(self, callback: Callable[[Self], None]) -> None:
        """Call ``callback(pending)`` once at the end, on the thread that brings it; at once when it is there."""
        self.call_at_end(lambda: callback(self))

    def resolve(self, value: T) -> None:
        """Give the answer; ignored when there is one."""
        self._settle(value, "")

    def fail(self, reason: str) -> None:
        """End without a response, for this reason; ignored when there is one."""
        self._settle(None, reason or "there is no answer")

    def _settle(self, value: T | None, failure: str) -> None:
        with self._lock:
            if self._settled:
                return
            self._settled, self._value, self._failure = True, value, failure
        self._end()

    def __await__(self) -> Generator[object, None, T]:
        yield from self.ending()
        return self.value
