"""Hooks of the skillset `navigation`: takeoff, goto, goto_straight, rotate_head, lock_head, hover, land."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

from navigation_managers.hooks import (
    AbstractGotoSkill,
    AbstractGotoStraightSkill,
    AbstractHoverSkill,
    AbstractLandSkill,
    AbstractLockHeadSkill,
    AbstractRotateHeadSkill,
    AbstractTakeoffSkill,
)

from uav_skills import checks, decisions
from uav_skills.calls import Reply, ignore_response
from uav_skills.decisions import SkillEnd
from uav_skills.functional import GuidanceApi
from uav_skills.guided import GuidedMotion, GuidedSkill

if TYPE_CHECKING:
    from geometry_msgs.msg import Point
    from navigation_managers.inputs import GotoInputs, GotoStraightInputs, HoverInputs, LockHeadInputs, RotateHeadInputs, TakeoffInputs
    from rclpy.node import Node
    from uav_msgs.msg import GuidanceState

    from alula import Execution, SkillHooks

LOCK_RATE_RAD_S = 0.6


class Takeoff(GuidedSkill, AbstractTakeoffSkill):  # type: ignore[misc]  # generated
    """Climb to a height above home (paper, Listings 3 and 4)."""

    reference = "takeoff"
    success = "AT_ALTITUDE"

    def validate(self, inputs: TakeoffInputs) -> str:
        """Refuse a height (m) or speed (m/s) out of bounds."""
        return checks.check_takeoff(height_m=inputs.height, speed_m_s=inputs.speed)

    def send(self, motion: GuidedMotion) -> None:
        """Ask the guidance for the climb."""
        inputs = motion.inputs
        self.guidance.takeoff(height_m=inputs.height, speed_m_s=inputs.speed, reply=functools.partial(self.on_response, motion))

    def decide(self, motion: GuidedMotion, state: GuidanceState) -> SkillEnd | None:  # noqa: ARG002
        """End at altitude, adrift, or blocked."""
        return decisions.decide_takeoff(state, self.thresholds)

    def remaining(self, state: GuidanceState) -> float:
        """Return the metres left to climb."""
        return abs(float(state.vertical_to_go_m))


class _Flight(GuidedSkill):
    """Fly to a point; what both ways of doing so share."""

    reference = "position"
    success = "ARRIVED"
    along_travel = False

    def validate(self, inputs: GotoInputs | GotoStraightInputs) -> str:
        """Refuse a target (frame map, m) or speed (m/s) out of bounds."""
        target = inputs.target
        return checks.check_target(target_enu_m=(target.x, target.y, target.z), speed_m_s=inputs.speed)

    def send(self, motion: GuidedMotion) -> None:
        """Give the guidance the target as its position reference."""
        target: Point = motion.inputs.target
        speed_m_s, reply = motion.inputs.speed, functools.partial(self.on_response, motion)
        self.guidance.set_position(target_enu_m=target, speed_m_s=speed_m_s, along_travel=self.along_travel, reply=reply)

    def on_pause(self, execution: Execution) -> str:
        """Hover; the way to the target is kept."""
        motion = self._motion
        if motion is None or motion.execution is not execution or motion.reference_id is None:
            return "the guidance has not taken the target yet"
        motion.reference_id = None  # from now on the guidance speaks of something else
        self.stop()
        return ""

    def on_resume(self, execution: Execution) -> str:
        """Give the position reference again."""
        motion = self._motion
        if motion is None or motion.execution is not execution:
            return "the way to the target is forgotten"
        self._ask(motion)
        return ""

    def decide(self, motion: GuidedMotion, state: GuidanceState) -> SkillEnd | None:  # noqa: ARG002
        """End on arrival, off the line, or blocked."""
        return decisions.decide_goto(state, self.thresholds)


class Goto(_Flight, AbstractGotoSkill):  # type: ignore[misc]  # generated
    """Fly to a point and leave the heading alone."""


class GotoStraight(_Flight, AbstractGotoStraightSkill):  # type: ignore[misc]  # generated
    """Fly to a point with the nose along the travel."""

    along_travel = True


class RotateHead(GuidedSkill, AbstractRotateHeadSkill):  # type: ignore[misc]  # generated
    """Turn to a heading on the spot."""

    reference = "heading"
    success = "ALIGNED"

    def validate(self, inputs: RotateHeadInputs) -> str:
        """Refuse a heading (rad) that is no number, or a rate (rad/s) out of bounds."""
        return checks.check_turn(heading_rad=inputs.heading, rate_rad_s=inputs.rate)

    def send(self, motion: GuidedMotion) -> None:
        """Give the guidance the heading as its reference."""
        inputs, reply = motion.inputs, functools.partial(self.on_response, motion)
        self.guidance.set_heading(heading_rad=inputs.heading, rate_rad_s=inputs.rate, lock=False, reply=reply)

    def decide(self, motion: GuidedMotion, state: GuidanceState) -> SkillEnd | None:  # noqa: ARG002
        """End aligned, or when it does not turn on."""
        return decisions.decide_rotation(state, self.thresholds)

    def remaining(self, state: GuidanceState) -> float:
        """Return the radians left to turn."""
        return abs(float(state.heading_error_rad))


class LockHead(GuidedSkill, AbstractLockHeadSkill):  # type: ignore[misc]  # generated
    """Hold a heading while other skills move the vehicle, until interrupted."""

    def validate(self, inputs: LockHeadInputs) -> str:
        """Refuse a heading (rad) that is no finite number."""
        return "" if math.isfinite(inputs.heading) else f"heading is {inputs.heading}, not a finite number"

    def send(self, motion: GuidedMotion) -> None:
        """Have the guidance turn to the heading and hold it during later motions."""
        heading_rad, reply = motion.inputs.heading, functools.partial(self.on_response, motion)
        self.guidance.set_heading(heading_rad=heading_rad, rate_rad_s=LOCK_RATE_RAD_S, lock=True, reply=reply)

    def stop(self, reply: Reply = ignore_response) -> None:
        """Release the heading; the motion goes on."""
        self.guidance.release_heading(reply)

    def progress(self, execution: Execution) -> float:
        """Return whether the heading is held."""
        motion = self._motion
        return 1.0 if motion is not None and motion.execution is execution and motion.followed_since_s is not None else 0.0

    def lost(self, silent_s: float) -> SkillEnd:
        """End when the heading is not held: it was released from elsewhere, or never held."""
        return SkillEnd("ABORTED", f"the heading is not locked for {silent_s:.1f} s")

    def _on_state(self, state: GuidanceState) -> None:
        """Look at the lock only: the reference that the state speaks of is that of the motion."""
        motion = self._motion
        if motion is not None and motion.reference_id is not None and state.heading_locked:
            motion.heard_s = self.guidance.now_s
            motion.followed_since_s = motion.followed_since_s or motion.heard_s


class Hover(GuidedSkill, AbstractHoverSkill):  # type: ignore[misc]  # generated
    """Stay where the vehicle is for a while of mission clock."""

    reference = "hover"
    success = "DONE"

    def validate(self, inputs: HoverInputs) -> str:
        """Refuse a duration (s) out of bounds."""
        return checks.check_duration(duration_s=inputs.duration)

    def send(self, motion: GuidedMotion) -> None:
        """Have the guidance hold the position."""
        self.guidance.hover(functools.partial(self.on_response, motion))

    def decide(self, motion: GuidedMotion, state: GuidanceState) -> SkillEnd | None:  # noqa: ARG002
        """Succeed once the vehicle has hovered for the duration."""
        return decisions.decide_hover(self._hovered_s(motion), motion.inputs.duration)

    def progress(self, execution: Execution) -> float:
        """Tell how much of the time is over."""
        motion = self._motion
        if motion is None or motion.execution is not execution:
            return 0.0
        return min(1.0, self._hovered_s(motion) / float(motion.inputs.duration))

    @staticmethod
    def _hovered_s(motion: GuidedMotion) -> float:
        return 0.0 if motion.followed_since_s is None else motion.heard_s - motion.followed_since_s


class Land(GuidedSkill, AbstractLandSkill):  # type: ignore[misc]  # generated
    """Land where the vehicle is. A landing that does not come lower goes on while the mission decides."""

    reference = "land"
    success = "LANDED"
    stops_when_it_fails = False

    def send(self, motion: GuidedMotion) -> None:
        """Ask the guidance for the landing."""
        self.guidance.land(functools.partial(self.on_response, motion))

    def decide(self, motion: GuidedMotion, state: GuidanceState) -> SkillEnd | None:  # noqa: ARG002
        """End on the ground with the motors off, or when it does not come lower."""
        return decisions.decide_landing(state, self.thresholds)


HOOKS: dict[str, type[GuidedSkill]] = {
    "takeoff": Takeoff,
    "goto": Goto,
    "goto_straight": GotoStraight,
    "rotate_head": RotateHead,
    "lock_head": LockHead,
    "hover": Hover,
    "land": Land,
}


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills of the skillset."""
    # With a process a skill, all hooks are made in each, but only those of the skill that it serves are called.
    served = getattr(node, "served_skills", tuple(HOOKS))
    guidance = GuidanceApi(node, orphans={HOOKS[skill].reference for skill in served})
    return {skill: hooks(guidance) for skill, hooks in HOOKS.items()}
