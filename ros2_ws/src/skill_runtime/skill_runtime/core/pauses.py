"""Pause and resume, where the hooks of a skill support them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from skill_model.execution_state import ExecutionState
from skill_runtime.core.floor import Floor
from skill_runtime.core.ledger import Entry
from skill_runtime.core.stops import Stops


@dataclass(frozen=True)
class PauseReply:
    """Answer to a pause or a resumption; ``reason`` is empty when it is accepted."""

    accepted: bool
    reason: str = ""


Reply = Callable[[PauseReply], None]


class Pauses:
    """Pauses and resumes executions; a paused one holds its resources, and its invariants are watched."""

    def __init__(self, floor: Floor, stops: Stops) -> None:
        self._floor = floor
        self._stops = stops

    def set_paused(self, execution_id: str, *, paused: bool, reply: Reply, wait: bool = True) -> None:
        """Pause or resume; ``reply`` is called once, when the hook has answered or there is nothing to ask.

        While the execution is being started, paused or resumed, this waits for its turn; without ``wait`` it is refused then.
        """
        with self._floor.lock:
            entry = self._floor.ledger.entries.get(execution_id)
            known = _known_reply(execution_id, entry, paused=paused)
            if entry is not None and known is None:
                if entry.dispatching and wait:
                    entry.waiting.append(lambda: self.set_paused(execution_id, paused=paused, reply=reply))
                    return
                if entry.dispatching:
                    reason = f"{entry.key.skill} {execution_id} is being started, paused or resumed"
                    known = PauseReply(accepted=False, reason=reason)
                else:
                    entry.dispatching = True
        if entry is None or known is not None:
            reply(known or PauseReply(accepted=False))
            return
        hook = "on_pause" if paused else "on_resume"
        self._floor.call(entry, hook, lambda answer: self._answered(entry, answer, reply, paused=paused))

    def _answered(self, entry: Entry, answer: object, reply: Reply, *, paused: bool) -> None:
        """Enter the phase unless the hook refused or something else has come between."""
        verb, phase = ("paused", ExecutionState.PAUSED) if paused else ("resumed", ExecutionState.RUNNING)
        with self._floor.lock:
            state = entry.execution.state
            reason = str(answer or "")
            if state.terminal or state is ExecutionState.INTERRUPTING:
                reason = f"it was {state.value} before it was {verb}"
            elif not reason:
                self._expect_progress(entry, paused=paused)
                self._floor.ledger.enter_phase(entry, phase)
        self._floor.deliver()
        reply(PauseReply(not reason, reason))
        self._stops.hook_returned(entry)

    def _expect_progress(self, entry: Entry, *, paused: bool) -> None:
        """Let the progress deadline rest during the pause, and begin anew after it."""
        if paused:
            self._floor.ledger.interrupting(entry)
        else:
            self._floor.ledger.progressed(entry)


def _known_reply(execution_id: str, entry: Entry | None, *, paused: bool) -> PauseReply | None:
    """Return the answer where no hook has to be asked for it."""
    if entry is None or entry.execution.done:
        return PauseReply(accepted=False, reason=f"there is no execution {execution_id} that has not ended")
    state = entry.execution.state
    if state is (ExecutionState.PAUSED if paused else ExecutionState.RUNNING) and not entry.dispatching:
        return PauseReply(accepted=True)
    if state in {ExecutionState.REQUESTED, ExecutionState.INTERRUPTING}:
        return PauseReply(accepted=False, reason=f"{entry.key.skill} {execution_id} is {state.value}")
    return None
