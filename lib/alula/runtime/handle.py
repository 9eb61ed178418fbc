"""One execution as its client sees it, over any middleware."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from alula.model.execution_state import ExecutionState
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.waiting import Moment, Pending, Waitable, Waiter

if TYPE_CHECKING:
    from typing import Self  # of Python 3.11

OutputsT = TypeVar("OutputsT", bound=Mapping[str, object])
ResultT = TypeVar("ResultT", bound=str)

REPORTS_KEPT = 1000
"""Reports that a reader may lag behind; the oldest are dropped for a slower one, never the last."""


class SkillFailedError(SkillRuntimeError):
    """An execution did not end as it was expected to; the message says how it did."""


class StillRunningError(SkillRuntimeError):
    """An execution has not ended within the time that was given."""


@dataclass(frozen=True)
class Ended(Generic[OutputsT, ResultT]):
    """How an execution ended; ``result`` and ``outputs`` are as in ``Handle``."""

    skill: str
    id: str
    state: ExecutionState
    result: str
    message: str
    outputs: OutputsT

    @property
    def outcome(self) -> str:
        """Name of the terminal state."""
        return self.state.value

    def expect(self, *results: ResultT) -> Self:
        """Return this when the skill ended by itself with one of the results (with none given: with any).

        Raises:
            SkillFailedError: it ended otherwise.
        """
        if self.state is ExecutionState.TERMINATED and (not results or self.result in results):
            return self
        wanted = " or ".join(results) or "a result"
        raise SkillFailedError(f"{self.skill} should have ended with {wanted}, but {self}")

    def __str__(self) -> str:
        # The message of a precondition or an invariant begins with its name.
        named = self.message.startswith(f"{self.result}: ")
        why = self.message if named else ": ".join(part for part in (self.result, self.message) if part)
        return f"{self.outcome}{f' ({why})' if why else ''}"


@dataclass(frozen=True)
class HandleReport(Generic[OutputsT]):
    """An execution at one moment; the last report of one has a terminal state."""

    state: ExecutionState
    progress: float
    outputs: OutputsT


class Handle(Waitable, Generic[OutputsT, ResultT]):
    """A requested execution. It may be read and used from any thread; only methods that say so wait.

    ``result`` names the model's result when TERMINATED, the precondition when NOT_READY, the invariant when
    RESOURCE_INVARIANT_VIOLATED. ``outcome`` is the terminal state's name, empty before.

    ``handle.wait(timeout_s)`` and ``handle.get(timeout_s)`` block, ``await handle`` suspends a coroutine of asyncio or of an
    rclpy executor, ``for report in handle`` and ``async for report in handle`` follow it to its end. Each of them ends, at the
    latest, when the managers have gone.
    """

    def __init__(
        self,
        skill: str,
        execution_id: str,
        interrupt: Callable[[], None] | None = None,
        *,
        pause: Callable[[bool], Pending[str]] | None = None,
        waiter: Waiter | None = None,
    ) -> None:
        super().__init__(waiter)
        self.skill = skill
        self.id = execution_id
        self.state = ExecutionState.REQUESTED
        self.outcome = ""
        self.result = ""
        self.message = ""
        self.outputs = cast("OutputsT", {})
        self.progress = 0.0
        self._interrupt = interrupt
        self._pause = pause
        self._listeners: list[Callable[[HandleReport[OutputsT]], None]] = []
        self._request_listeners: list[Callable[[str], None]] = []

    @property
    def done(self) -> bool:
        """Return whether the execution has ended and its outcome is known."""
        return self.state.terminal

    @property
    def ended(self) -> Ended[OutputsT, ResultT] | None:
        """How it ended; None before."""
        if not self.done:
            return None
        return Ended(self.skill, self.id, self.state, self.result, self.message, self.outputs)

    def interrupt(self) -> None:
        """Ask for the end; returns at once, without effect when it has ended already."""
        if not self.done and self._interrupt is not None:
            self._requested("interrupt")
            self._interrupt()

    def pause(self) -> Pending[str]:
        """Ask for a pause; the answer is "", or why not: not every skill's hooks can pause."""
        return self._set_paused(paused=True)

    def resume(self) -> Pending[str]:
        """Ask to go on after a pause; the answer is "", or why not."""
        return self._set_paused(paused=False)

    def _set_paused(self, *, paused: bool) -> Pending[str]:
        if not self.done and self._pause is not None:
            self._requested("pause" if paused else "resume")
            return self._pause(paused)
        refused: Pending[str] = Pending(self._waiter)
        refused.resolve(f"{self.skill} has ended" if self.done else f"{self.skill} can't be paused")
        return refused

    def get(self, timeout_s: float) -> Ended[OutputsT, ResultT]:
        """Wait (wall clock) for the end and return it; raise as ``wait`` does, and StillRunningError after the time."""
        if self.wait(timeout_s):
            return self._end_of_it()
        raise StillRunningError(f"{self.skill} is {self.state.value} and has not ended within {timeout_s:g} s")

    def add_done_callback(self, callback: Callable[[Self], None]) -> None:
        """Call ``callback(handle)`` once at the end, on the thread that brings it; at once when it has ended."""
        self.call_at_end(lambda: callback(self))

    def on_report(self, callback: Callable[[HandleReport[OutputsT]], None]) -> None:
        """Call ``callback(report)`` at each change of state, progress or outputs, on the thread that brings it."""
        with self._lock:
            self._listeners.append(callback)

    def on_request(self, callback: Callable[[str], None]) -> None:
        """Call ``callback(kind)`` when something is asked of the execution: ``interrupt``, ``pause`` or ``resume``."""
        with self._lock:
            self._request_listeners.append(callback)

    def reports(self) -> Reports[OutputsT]:
        """Follow the execution from now to its end, in a ``for`` or an ``async for``."""
        return Reports(self, self._waiter)

    def __iter__(self) -> Reports[OutputsT]:
        return self.reports()

    def __aiter__(self) -> Reports[OutputsT]:
        return self.reports()

    def __await__(self) -> Generator[object, None, Ended[OutputsT, ResultT]]:
        yield from self.ending()
        return self._end_of_it()

    def __repr__(self) -> str:
        return f"SkillHandle({self.skill} {self.id} {self.state.value} {self.result})"

    def _end_of_it(self) -> Ended[OutputsT, ResultT]:
        ended = self.ended
        assert ended is not None  # noqa: S101 - the end was waited for
        return ended

    def _report(self) -> HandleReport[OutputsT]:
        return HandleReport(self.state, self.progress, self.outputs)

    # --- for the client ----------------------------------------------------------------------------------------------

    def enter(self, state: ExecutionState) -> None:
        """Be in a state that is not terminal, unless it has ended."""
        with self._lock:
            if self.done or self.state is state:
                return
            self.state = state
        self._tell()

    def run(self, progress: float = 0.0, outputs: Mapping[str, object] | None = None) -> None:
        """Take news of a started execution: progress and outputs."""
        with self._lock:
            if self.done:
                return
            before = self._report()
            if self.state is ExecutionState.REQUESTED:
                self.state = ExecutionState.RUNNING
            self.progress = max(self.progress, progress) if outputs is None else progress
            if outputs:
                self.outputs = cast("OutputsT", dict(outputs))
            if self._report() == before:
                return
        self._tell()

    def end(self, state: ExecutionState, result: str, message: str, outputs: Mapping[str, object] | None = None) -> None:
        """Enter a terminal state, unless it has one."""
        with self._lock:
            if self.done:
                return
            self.result, self.message = result, message
            if outputs:
                self.outputs = cast("OutputsT", dict(outputs))
            self.outcome = state.value
            self.state = state
        try:
            self._tell()
        finally:
            self._end()

    def fail(self, message: str) -> None:
        """End as FAILED for a reason on the client's side."""
        self.end(ExecutionState.FAILED, "", message)

    def _requested(self, kind: str) -> None:
        with self._lock:
            listeners = list(self._request_listeners)
        for listener in listeners:
            listener(kind)

    def _tell(self) -> None:
        with self._lock:
            listeners, report = list(self._listeners), self._report()
        for listener in listeners:
            listener(report)


SkillHandle = Handle[dict[str, Any], str]
"""The handle of a client that knows the skill by name only."""


class Reports(Generic[OutputsT]):
    """The reports of one execution, from where it was when they were asked for to its end; for one reader."""

    def __init__(self, handle: Handle[OutputsT, Any], waiter: Waiter) -> None:
        self._handle = handle
        self._waiter = waiter
        self._waiting: deque[HandleReport[OutputsT]] = deque(maxlen=REPORTS_KEPT)
        self._news = Moment(waiter)
        self._over = False
        handle.on_report(self._take)
        if not self._waiting:
            self._take(HandleReport(handle.state, handle.progress, handle.outputs))

    def _take(self, report: HandleReport[OutputsT]) -> None:
        self._waiting.append(report)
        news, self._news = self._news, Moment(self._waiter)
        news.come()

    def _next(self) -> HandleReport[OutputsT] | None:
        """Return the next report if it is here; skip what comes after the end."""
        if self._over or not self._waiting:
            return None
        report = self._waiting.popleft()
        self._over = report.state.terminal
        return report

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> HandleReport[OutputsT]:
        """Wait for the next report; raise as ``Handle.wait`` does."""
        while not self._over:
            news = self._news
            report = self._next()
            if report is not None:
                return report
            news.wait_for_it()
        raise StopIteration

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> HandleReport[OutputsT]:
        while not self._over:
            news = self._news
            report = self._next()
            if report is not None:
                return report
            await news
        raise StopAsyncIteration
