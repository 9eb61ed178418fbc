"""The stop contract: an interruption is asked for, then done; when that takes too long, it is an emergency.

Asked: the execution is INTERRUPTING (its resources are still held, it may still end by a result or a violation), and
``on_interrupt`` is called, after ``on_dispatch`` if that has not returned. Done: the interrupt effect is applied, as soon as
``on_interrupt`` returns, or, when it returns False, as soon as ``execution.interrupted()`` is called. Too late: ``on_emergency`` is
called, whatever other hook still waits, and the execution ends INTERRUPTED with its effect and a message that says so.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

from skill_model import semantics
from skill_model.execution_state import ExecutionState
from skill_runtime.core.floor import Floor
from skill_runtime.core.ledger import Entry

DEFAULT_TIMEOUT_S = 5.0
"""How long a stop may take where the model does not say."""


@dataclass(frozen=True)
class _Deadline:
    entry: Entry
    due_ns: int
    timeout_s: float


class Stops:
    """Interrupts executions and watches that it gets done."""

    def __init__(self, floor: Floor, timeout_s: float) -> None:
        self._floor = floor
        self._timeout_s = timeout_s
        self._deadlines: dict[str, _Deadline] = {}

    def interrupt(self, execution_id: str) -> bool:
        """Ask for the end of an execution; False when it has ended or is not known."""
        floor = self._floor
        with floor.lock:
            entry = floor.ledger.entries.get(execution_id)
            if entry is None or entry.execution.done:
                return False
            now = False
            if entry.execution.state is ExecutionState.REQUESTED:
                floor.ledger.end_request(entry, ExecutionState.INTERRUPTED, "interrupted before it started")
            elif not entry.stop_hook:
                self._ask(entry)
                now = not entry.dispatching
        floor.deliver()
        if now:
            self._stop(entry)
        return True

    def hook_returned(self, entry: Entry) -> None:
        """Do what was asked for while a hook was called that no stop overtakes.

        Also after an emergency: what a late ``on_dispatch`` or ``on_resume`` has started is not stopped yet.
        """
        floor = self._floor
        with floor.lock:
            entry.dispatching = False
            stop = bool(entry.stop_hook) and entry.execution.state is not ExecutionState.TERMINATED
            floor.ledger.forget_if_through(entry)
            waiting, entry.waiting = entry.waiting, []
        if stop:
            self._stop(entry)
        for job in waiting:
            job()

    def interrupted(self, execution_id: str, message: str = "") -> bool:
        """Take the step of the interruption: the stop is done. False when none is under way."""
        floor = self._floor
        with floor.lock:
            entry = floor.ledger.running(execution_id)
            if entry is None or entry.execution.state is not ExecutionState.INTERRUPTING:
                return False
            step = semantics.interrupt(floor.skillset, floor.ledger.situation, entry.key, message)
            stops = floor.ledger.commit(step, by_itself=entry)
        floor.after_step(stops)
        return True

    def due_ns(self) -> int | None:
        """Return when the next stop is too late, None when none is under way; called with the lock held."""
        self._deadlines = {key: deadline for key, deadline in self._deadlines.items() if not deadline.entry.execution.done}
        return min((deadline.due_ns for deadline in self._deadlines.values()), default=None)

    def tick(self) -> None:
        """Escalate the stops that are too late."""
        with self._floor.lock:
            now_ns = self._floor.clock_ns()
            late = [deadline for deadline in self._deadlines.values() if deadline.due_ns <= now_ns and not deadline.entry.execution.done]
            for deadline in late:
                del self._deadlines[deadline.entry.key.id]
        for deadline in late:
            # First the strongest stop, then what the execution held is given back.
            self._floor.defer(functools.partial(self._floor.call, deadline.entry, "on_emergency"))
            self.interrupted(deadline.entry.key.id, f"the stop was not done within {deadline.timeout_s:g} s; the emergency stop was called")

    def _ask(self, entry: Entry) -> None:
        timeout_s = self._floor.skillset.skill(entry.key.skill).interrupt.timeout_s or self._timeout_s
        entry.stop_hook = "on_interrupt"
        self._floor.ledger.interrupting(entry)
        self._floor.ledger.enter_phase(entry, ExecutionState.INTERRUPTING)
        self._deadlines[entry.key.id] = _Deadline(entry, self._floor.clock_ns() + round(timeout_s * 1e9), timeout_s)

    def _stop(self, entry: Entry) -> None:
        """Call the decided stop hook; the interruption is done with it unless it says otherwise."""

        def returned(answer: object) -> None:
            if answer is not False:
                self.interrupted(entry.key.id)

        self._floor.call(entry, entry.stop_hook, returned)
