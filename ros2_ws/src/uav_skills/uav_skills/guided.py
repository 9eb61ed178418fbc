"""What all skills of the navigation have in common: a reference given to the guidance, followed until a verdict.

The life of one execution (paper, Listing 4): ``on_dispatch`` sends a command and returns; the response brings the reference's id;
every state of the guidance that speaks of this id is decided on; a verdict ends the execution. When the verdict is not the
success, the vehicle is told to hover: the motion is not watched any more. A guidance that speaks of something else, or not
at all, ends the execution, too: the reference is lost, or the command may not have arrived.
"""

from __future__ import annotations

import functools
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from alula import SkillHooks
from uav_skills.calls import Reply, Response, ignore_response
from uav_skills.decisions import DEFAULT_THRESHOLDS, UNHEARD, SkillEnd, Thresholds, remaining_part, speaks_of

if TYPE_CHECKING:
    from uav_msgs.msg import GuidanceState

    from alula import Execution
    from uav_skills.functional import GuidanceApi

AUTHORITY_INVARIANT = "keep_sdk_authority"


@dataclass
class GuidedMotion:
    """One execution's reference; times are seconds of mission clock."""

    execution: Execution
    reference_id: int | None = None
    asked_s: float | None = None  # since when a response to the command is waited for
    heard_s: float = 0.0
    followed_since_s: float | None = None
    initial: float = 0.0
    remaining: float = 0.0

    @property
    def inputs(self) -> Any:
        """The skill's generated class of inputs."""
        return self.execution.inputs


class GuidedSkill(SkillHooks):
    """Base of the hooks of the navigation; subclasses send their command and decide on states.

    The skillset's axes and heading authorities see to it that a skill has one execution at a time.
    """

    reference: ClassVar[str] = ""
    """What the guidance calls a reference of this skill."""
    success: ClassVar[str] = ""
    """The result after which the reference stays as it is."""
    stops_when_it_fails: ClassVar[bool] = True
    """Whether any other result tells the vehicle to hover."""

    def __init__(self, guidance: GuidanceApi, thresholds: Thresholds = DEFAULT_THRESHOLDS) -> None:
        super().__init__()
        self.guidance = guidance
        self.thresholds = thresholds
        self._motion: GuidedMotion | None = None
        self._lock = threading.Lock()
        guidance.listen(self._on_state)
        guidance.watch(self._on_watch, lambda: self._motion is not None)

    # --- what a skill adds -------------------------------------------------------------------------------------------

    def send(self, motion: GuidedMotion) -> None:
        """Send the command; its response goes to ``self.on_response(motion)``."""
        raise NotImplementedError

    def decide(self, motion: GuidedMotion, state: GuidanceState) -> SkillEnd | None:
        """Say whether the execution ends; ``state`` speaks of its reference."""
        raise NotImplementedError

    def remaining(self, state: GuidanceState) -> float:
        """Return what is still to go, in the unit of the skill, for the progress."""
        return float(state.distance_to_go_m)

    def lost(self, silent_s: float) -> SkillEnd:
        """Say how the execution ends when the guidance does not speak of its reference any more, but of something else."""
        state = self.guidance.state
        instead = "nothing" if state is None else f"{state.reference or 'nothing'} {state.reference_id}"
        return SkillEnd("ABORTED", f"the guidance does not follow this reference for {silent_s:.1f} s; last it spoke of {instead}")

    def stop(self, reply: Reply = ignore_response) -> None:
        """Stop the function; ``reply`` gets the guidance's response."""
        self.guidance.hover(reply)

    # --- hooks -------------------------------------------------------------------------------------------------------

    def on_dispatch(self, execution: Execution) -> None:
        """Send the command of a new motion, and return without waiting for it."""
        motion = GuidedMotion(execution)
        with self._lock:
            self._motion = motion
        self.guidance.wake()
        self._ask(motion)

    def progress(self, execution: Execution) -> float:
        """Tell how much of the way is behind."""
        motion = self._motion
        if motion is None or motion.execution is not execution or motion.followed_since_s is None:
            return 0.0
        return remaining_part(motion.remaining, motion.initial)

    def on_interrupt(self, execution: Execution) -> bool:
        """Stop the vehicle; it is done when the guidance has taken the command."""
        self._forget(execution)
        self.stop(functools.partial(self._stopped, execution))
        return False

    def on_emergency(self, execution: Execution) -> None:
        """Ask once more, for what is stopped by then is no worse off: the guidance has not answered."""
        self._forget(execution)
        self.stop()

    def on_violation(self, execution: Execution) -> None:
        """Stop the vehicle, unless it is the pilot's now: then it must not get a command of ours."""
        self._forget(execution)
        if execution.result != AUTHORITY_INVARIANT:
            self.stop()

    # --- what the functional layer says ------------------------------------------------------------------------------

    def on_response(self, motion: GuidedMotion, response: Response) -> None:
        """Take the response to the command."""
        if self._motion is not motion:
            return  # interrupted meanwhile: the command that stops it is in the queue behind
        if not response.accepted:
            self._end(motion, SkillEnd("ABORTED", response.failure), stop=not response.answered and self._should_stop(motion))
            return
        motion.asked_s, motion.heard_s = None, self.guidance.now_s
        motion.reference_id = response.reference_id

    @staticmethod
    def _stopped(execution: Execution, response: Response) -> None:
        """Take the response to the stop of an interruption: refused on the ground, just above it in a landing, or without authority."""
        execution.interrupted("" if response.accepted else f"the stop was not taken: {response.reason}")

    def _on_state(self, state: GuidanceState) -> None:
        motion = self._motion
        if motion is None or motion.reference_id is None:
            return
        if not speaks_of(state, kind=self.reference, reference_id=motion.reference_id):
            return
        motion.heard_s = self.guidance.now_s
        motion.remaining = self.remaining(state)
        if motion.followed_since_s is None:
            motion.followed_since_s, motion.initial = motion.heard_s, motion.remaining
        verdict = self.decide(motion, state)
        if verdict is not None:
            self._end(motion, verdict, stop=verdict.result != self.success)

    def _on_watch(self) -> None:
        motion = self._motion
        if motion is None:
            return
        verdict = self._unanswered(motion) if motion.reference_id is None else self._unfollowed(motion)
        if verdict is not None:
            self._end(motion, verdict, stop=self._should_stop(motion))

    def _unanswered(self, motion: GuidedMotion) -> SkillEnd | None:
        """Say how an execution ends whose command is not answered, because the guidance is not heard of since; None: wait."""
        return None if motion.asked_s is None else self._unheard(motion.asked_s)

    def _unfollowed(self, motion: GuidedMotion) -> SkillEnd | None:
        """Say how an execution ends of whose reference the guidance does not speak; None: it does, or did a moment ago."""
        silent_s = self.guidance.now_s - motion.heard_s
        return (self._unheard() or self.lost(silent_s)) if silent_s > self.thresholds.reference_lost_s else None

    def _unheard(self, since_s: float = 0.0) -> SkillEnd | None:
        """Say how the execution ends when the guidance does not speak at all, since then at least; None: it does."""
        heard_s = self.guidance.heard_s
        silent_s = self.guidance.now_s - max(since_s, 0.0 if heard_s is None else heard_s)
        if silent_s <= self.thresholds.reference_lost_s:
            return None
        return SkillEnd("ABORTED", f"nothing is heard of the guidance for {silent_s:.1f} s: {UNHEARD}")

    def _should_stop(self, motion: GuidedMotion) -> bool:
        """Return whether a hover is to follow a motion that is not watched any more.

        Not while the vehicle is being landed, perhaps because no mission decides: it would stay in the air. Nor after a hover that may
        still arrive: another one might arrive after the landing that the mission asks for next.
        """
        state = self.guidance.state
        asked = motion.reference_id is None and self.reference == "hover"
        return not asked and (state is None or state.reference != "land")

    def _ask(self, motion: GuidedMotion) -> None:
        motion.asked_s = self.guidance.now_s
        self.send(motion)

    def _end(self, motion: GuidedMotion, verdict: SkillEnd, *, stop: bool) -> None:
        with self._lock:
            if self._motion is not motion:
                return
            self._motion = None
        if stop and self.stops_when_it_fails:
            self.stop()
        motion.execution.terminate(verdict.result, verdict.message)

    def _forget(self, execution: Execution) -> None:
        with self._lock:
            if self._motion is not None and self._motion.execution is execution:
                self._motion = None
