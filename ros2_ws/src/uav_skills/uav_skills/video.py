"""Hooks of the skillset `video`: stream."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from video_managers.hooks import AbstractStreamSkill

from uav_skills.checks import check_stream
from uav_skills.decisions import decide_stream
from uav_skills.functional import VideoApi
from uav_skills.watched import WatchedSkill

if TYPE_CHECKING:
    from rclpy.node import Node
    from video_managers.inputs import StreamInputs

    from alula import Execution, SkillHooks
    from uav_skills.decisions import SkillEnd


class Stream(WatchedSkill, AbstractStreamSkill):  # type: ignore[misc]  # generated
    """Send the video until interrupted. The progress is 1 once the telepilot sees pictures.

    That the criteria are missed is the model's to notice: its invariants watch the margins. An encoder that died can tell nothing of them.
    """

    def __init__(self, video: VideoApi) -> None:
        super().__init__(video)
        self._video = video

    def validate(self, inputs: StreamInputs) -> str:
        """Refuse criteria that make no sense."""
        return check_stream(min_fps=inputs.min_fps, min_quality=inputs.min_quality, patience_s=inputs.patience)

    def switch_on(self, execution: Execution) -> None:
        """Begin to send, with the criteria."""
        inputs: StreamInputs = execution.inputs
        reply = functools.partial(self.on_response, execution)
        self._video.begin(min_fps=inputs.min_fps, min_quality=inputs.min_quality, patience_s=inputs.patience, reply=reply)

    def switch_off(self) -> None:
        """Have the node end the stream."""
        self._video.stop()

    def shows_s(self) -> float | None:
        """When the telepilot was last known to see pictures."""
        return self._video.seen_s

    def heard_s(self) -> float | None:
        """When the encoder last said that it sends."""
        return self._video.sending_s

    def decide(self, silent_s: float) -> SkillEnd | None:
        """End as LOST when it no longer says so."""
        return decide_stream(silent_s, told_idle=self._video.told_idle)


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills of the skillset."""
    return {"stream": Stream(VideoApi(node))}
