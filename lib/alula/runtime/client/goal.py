"""Follows one goal from its sending to its end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from alula.model.execution_state import ExecutionState
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.handle import SkillHandle
from alula.runtime.middleware import ActionLink, GoalResult, Middleware
from alula.runtime.timers import Timer
from alula.runtime.waiting import Pending

ACKNOWLEDGE_S = 5.0
"""Managers accept any goal at once. Without any message of theirs for so long (wall clock), the goal is given up."""
ACKNOWLEDGE_LIMIT = 12
"""So many times as long while the managers send messages about other goals."""
SILENCE_S = 10.0
"""After so long without a message about an accepted goal, its result is asked for."""
GRACE_S = 5.0
"""An end waits so long (wall clock) for the resources after its step, and a result for its event: on a busy machine they come seconds
apart, and who is told of an end before its cause takes the wrong way on. Managers that have gone are not waited for."""
LOST_S = 0.5
"""A result waits so long for its event where events got lost, which its own may be one of."""


class KnownStates(Protocol):
    """The part of a client's knowledge that a goal needs."""

    @property
    def states_after(self) -> int:
        """The number of the last event that the known resources include."""
        ...

    @property
    def received(self) -> int:
        """How many messages of the managers have arrived."""
        ...


class GoalTracker:
    """One goal; ``handle`` is what the caller gets. All but ``_interrupt`` runs on the middleware's loop.

    ``on_over(tracker, orphan)`` is called at its end; ``orphan``: the handle gave up, and the managers may still run the goal.
    """

    def __init__(
        self,
        middleware: Middleware,
        skillset: str,
        skill: str,
        link: ActionLink,
        known: KnownStates,
        *,
        pause: Callable[[str, bool], Pending[str]],
        on_over: Callable[[GoalTracker, bool], None],
    ) -> None:
        identifier = middleware.new_id()
        self.handle = SkillHandle(
            skill, identifier, self._interrupt, pause=lambda paused: pause(identifier, paused), waiter=middleware.waiter
        )
        self.link = link
        self.instance_id = ""
        """The managers that have acknowledged it; empty before."""
        self._middleware = middleware
        self._skillset = skillset
        self._known = known
        self._on_over = on_over
        self._lock = threading.Lock()
        self._acknowledged = False
        self._interrupt_wanted = False
        self._end: tuple[int, GoalResult] | None = None
        self._grace_s = GRACE_S
        self._looks = 0
        self._received = known.received
        self._timer: Timer | None = None
        self._feedback: tuple[float, Mapping[str, object]] = (0.0, {})

    def send(self, goal: Any) -> None:
        """Send the goal first, and set the timer afterwards."""
        self.link.send(self.handle.id, goal, self._on_answer)
        with self._lock:
            if not self._acknowledged and not self.handle.done:
                self._timer = self._middleware.later(ACKNOWLEDGE_S, self._look)

    def on_event(self, event: ExecutionEvent, after: int) -> None:
        """Take an event of this execution; its end is reported once the resources after event ``after`` have been received."""
        self.instance_id = event.instance_id
        self._acknowledge()
        self._cancel_timer()
        if not event.state.terminal:
            if event.state is not ExecutionState.REQUESTED:
                self.handle.enter(event.state)
            return
        outputs = self.link.outputs_of(_plain(event.outputs))
        self._end = (after, GoalResult(event.state, event.result, event.message, outputs))
        self.settle()
        if not self.handle.done:
            self._timer = self._middleware.later(GRACE_S, self._finish)

    def on_feedback(self, progress: float, outputs: Mapping[str, object]) -> None:
        """Take a feedback of this execution."""
        self._acknowledge()
        if (progress, outputs) != self._feedback or self.handle.state is ExecutionState.REQUESTED:
            self._feedback = (progress, dict(outputs))
            self.handle.run(progress, outputs)

    def on_result(self, ending: GoalResult | None) -> None:
        """Take the result of the action, and wait a little for the event of the same end, which is numbered."""
        if ending is None:
            self.abandon(f"the managers of {self._skillset} do not know this execution; were they restarted?")
        elif self._end is None and not self.handle.done:
            self._acknowledge()
            self._end = (2**63, ending)
            self._cancel_timer()
            self._timer = self._middleware.later(self._grace_s, self._finish)

    def ask(self) -> None:
        """Ask for the result, because events got lost."""
        self._grace_s = LOST_S
        self.link.request_result(self.handle.id)

    def settle(self) -> None:
        """End if the end is known, and the resources as they were after it."""
        if self._end is not None and self._known.states_after >= self._end[0]:
            self._finish()

    def abandon(self, reason: str, *, orphan: bool = False) -> None:
        """End because no message will come: with the end that is known, or else as FAILED for this reason."""
        if self._end is not None:
            self._finish()
            return
        self._cancel_timer()
        self._on_over(self, orphan)
        self.handle.fail(reason)

    # --- inside ------------------------------------------------------------------------------------------------------

    def _on_answer(self, taken: bool) -> None:  # noqa: FBT001 - as the answer has it
        if taken:
            self._acknowledge()
        elif not self._acknowledged:
            self.abandon(f"the managers of {self._skillset} did not take the goal")

    def _acknowledge(self) -> None:
        with self._lock:
            first, self._acknowledged = not self._acknowledged, True
            cancel = first and self._interrupt_wanted
        if first and not self.handle.done:
            self._cancel_timer()
            self._timer = self._middleware.later(SILENCE_S, self._look)
        if cancel:
            self.link.cancel(self.handle.id)

    def _interrupt(self) -> None:
        """Cancel; not before the goal was acknowledged, as the cancellation might overtake it."""
        with self._lock:
            self._interrupt_wanted = True
            now = self._acknowledged
        if now:
            self.link.cancel(self.handle.id)

    def _look(self) -> None:
        """Deal with silence: no message about this goal has come for a while."""
        if self.handle.done:
            return
        if self._acknowledged:
            # The messages may have got lost; managers that do not know the goal answer that.
            self.link.request_result(self.handle.id)
            self._timer = self._middleware.later(SILENCE_S, self._look)
            return
        self._looks += 1
        received, self._received = self._received, self._known.received
        if received != self._received and self._looks < ACKNOWLEDGE_LIMIT:
            self._timer = self._middleware.later(ACKNOWLEDGE_S, self._look)
        else:
            self.abandon(f"the managers of {self._skillset} did not answer within {self._looks * ACKNOWLEDGE_S:g} s", orphan=True)

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _finish(self) -> None:
        if self._end is None or self.handle.done:
            return
        self._cancel_timer()
        ending = self._end[1]
        self._on_over(self, False)
        self.handle.end(ending.state, ending.result, ending.message, ending.outputs)


def _plain(outputs: Mapping[str, object]) -> dict[str, object]:
    """Return outputs without those that JSON has no number for."""
    return {name: value for name, value in outputs.items() if value is not None}
