"""What all parts of the engine stand on: one lock, the ledger behind it, the way out for events, the way to the hooks."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Sequence

from skill_model import semantics
from skill_model.execution_state import ExecutionState
from skill_model.model import Skillset
from skill_runtime.core.events import EngineEvent, Listener
from skill_runtime.core.hook_calls import HookAnswer, HookCaller
from skill_runtime.core.ledger import Entry, Ledger
from skill_runtime.core.outbox import Outbox
from skill_runtime.core.records import Records

Job = Callable[[], None]
Afterwards = Callable[[object], None]


def nothing(_: object) -> None:
    """Do nothing more."""


class Floor:
    """All changes go through ``lock``; hooks and the listener are never called while it is held.

    Events are queued under the lock, so in the order of the steps, and delivered without it. See ``SkillsetEngine``.
    """

    def __init__(
        self,
        skillset: Skillset,
        clock_ns: Callable[[], int],
        hooks: HookCaller,
        listener: Listener,
        *,
        defer: Callable[[Job], None],
        on_error: Callable[[str], None],
    ) -> None:
        self.skillset = skillset
        self.clock_ns = clock_ns
        self.lock = threading.Lock()
        self.closed = ""
        self.records = Records(skillset)
        self.defer = defer
        self.on_error = on_error
        self.hooks = hooks
        self._outbox = Outbox(listener, on_error)
        self.ledger = Ledger(skillset, clock_ns, self._publish)

    def _publish(self, events: Sequence[EngineEvent]) -> None:
        self.records.on_events(events)
        self._outbox.put(events)

    def deliver(self) -> None:
        """Give what has happened to the listener; called without the lock."""
        self._outbox.deliver()

    def after_step(self, stops: list[Entry]) -> None:
        """Deliver events, then have the functions of executions that were ended stopped; called without the lock."""
        self.deliver()
        for entry in stops:
            self.defer(functools.partial(self.call, entry, entry.stop_hook))

    def elapse(self) -> None:
        """Take the step of what time alone has broken."""
        with self.lock:
            due_ns = self.ledger.due_ns
            if due_ns is None or (situation := self.ledger.situation).now_ns < due_ns:
                return
            stops = self.ledger.commit(semantics.elapse(self.skillset, situation))
        self.after_step(stops)

    def call(self, entry: Entry, hook: str, then: Afterwards = nothing) -> None:
        """Call a hook; what it raises ends its execution. ``then`` gets what it returns, None when it raised."""

        def answered(answer: HookAnswer) -> None:
            if answer.error:
                self.on_error(f"{entry.execution}: {hook} raised\n{answer.trace or answer.error}")
                self.fail(entry.key.id, f"{hook} raised {answer.error}")
            then(answer.value)

        self.hooks.call(entry.execution, hook, answered)

    def fail(self, execution_id: str, message: str) -> bool:
        """End an execution as FAILED; False when it has ended or is not known."""
        with self.lock:
            entry = self.ledger.entries.get(execution_id)
            if entry is None or entry.execution.done:
                return False
            stops: list[Entry] = []
            if entry.execution.state is ExecutionState.REQUESTED:
                self.ledger.end_request(entry, ExecutionState.FAILED, message)
            else:
                stops = self.ledger.commit(semantics.fail(self.skillset, self.ledger.situation, entry.key, message))
        self.after_step(stops)
        return True
