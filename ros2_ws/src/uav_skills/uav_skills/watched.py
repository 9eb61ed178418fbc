"""What the skills of perception and mapping have in common: a function that is switched on, and heard of while it works."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from alula import SkillHooks

if TYPE_CHECKING:
    from alula import Execution
    from uav_skills.calls import Response
    from uav_skills.decisions import SkillEnd
    from uav_skills.functional import FunctionalPart


class WatchedSkill(SkillHooks):
    """Base of hooks of a skill that runs until it is interrupted, as long as its function is heard of.

    An execution that starts while another one of the skill runs takes the watch over: the function is the same.
    """

    def __init__(self, part: FunctionalPart) -> None:
        super().__init__()
        self._part = part
        self._execution: Execution | None = None
        self._since_s = 0.0
        self._lock = threading.Lock()
        part.watch(self._on_watch, lambda: self._execution is not None)

    # --- what a skill adds -------------------------------------------------------------------------------------------

    def switch_on(self, execution: Execution) -> None:
        """Start the function; its response goes to ``self.on_response(execution)``."""
        raise NotImplementedError

    def switch_off(self) -> None:
        """Stop the function of the functional layer, without waiting for its response."""
        raise NotImplementedError

    def heard_s(self) -> float | None:
        """Return when the function was last heard of, None for never."""
        raise NotImplementedError

    def shows_s(self) -> float | None:
        """Return when it last did what it was switched on for; where nothing else is said, that is when it was heard of."""
        return self.heard_s()

    def decide(self, silent_s: float) -> SkillEnd | None:
        """Say whether the execution ends after this silence."""
        raise NotImplementedError

    # --- hooks -------------------------------------------------------------------------------------------------------

    def on_dispatch(self, execution: Execution) -> None:
        """Switch the function on and begin to listen."""
        with self._lock:
            self._execution, self._since_s = execution, self._part.now_s
        self._part.wake()
        self.switch_on(execution)

    def progress(self, execution: Execution) -> float:
        """Return 1 when the function has done its work since the start, else 0."""
        shows_s = self.shows_s()
        return 1.0 if execution is self._execution and shows_s is not None and shows_s > self._since_s else 0.0

    def on_interrupt(self, execution: Execution) -> None:
        """Switch the function off, unless the execution has ended by itself."""
        if self._forget(execution):
            self.switch_off()

    # --- what the functional layer says ------------------------------------------------------------------------------

    def on_response(self, execution: Execution, response: Response) -> None:
        """Take the answer to switching on."""
        if not response.accepted and self._forget(execution):
            execution.terminate("ABORTED", response.failure)

    def _on_watch(self) -> None:
        execution = self._execution
        if execution is None:
            return
        heard_s = self.heard_s()
        verdict = self.decide(self._part.now_s - max(self._since_s, self._since_s if heard_s is None else heard_s))
        if verdict is not None and self._forget(execution):
            self.switch_off()
            execution.terminate(verdict.result, verdict.message)

    def _forget(self, execution: Execution) -> bool:
        """Return whether this execution was the one that is watched, and watch no more."""
        with self._lock:
            mine = self._execution is execution
            self._execution = None if mine else self._execution
        return mine
