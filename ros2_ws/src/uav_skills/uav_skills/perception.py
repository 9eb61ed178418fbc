"""Hooks of the skillset `perception`: zed_depthmap and lidar_depthmap."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from perception_managers.hooks import AbstractLidarDepthmapSkill, AbstractZedDepthmapSkill

from alula import SkillHooks
from uav_skills.decisions import decide_watch
from uav_skills.functional import DepthApi, watch_of
from uav_skills.watched import WatchedSkill

if TYPE_CHECKING:
    from rclpy.node import Node

    from alula import Execution
    from uav_skills.decisions import SkillEnd


class _Depthmap(WatchedSkill):
    """Look ahead until interrupted. The progress is 1 once obstacle messages arrive: then a flight may begin."""

    def __init__(self, sensor: str, depth: DepthApi) -> None:
        super().__init__(depth)
        self._sensor = sensor
        self._depth = depth

    def switch_on(self, execution: Execution) -> None:
        """Have the sensor's node detect obstacles."""
        self._depth.enable(on=True, reply=functools.partial(self.on_response, execution))

    def switch_off(self) -> None:
        """Have the sensor's node detect no more."""
        self._depth.enable(on=False)

    def heard_s(self) -> float | None:
        """When the last obstacle message arrived."""
        return self._depth.heard_s

    def decide(self, silent_s: float) -> SkillEnd | None:
        """End as LOST when no more arrive."""
        return decide_watch(silent_s, self._sensor)


class ZedDepthmap(_Depthmap, AbstractZedDepthmapSkill):  # type: ignore[misc]  # generated
    """Depth map of the stereo camera."""


class LidarDepthmap(_Depthmap, AbstractLidarDepthmapSkill):  # type: ignore[misc]  # generated
    """Depth map of the LiDAR."""


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills of the skillset."""
    clock = watch_of(node)
    return {
        "zed_depthmap": ZedDepthmap("ZED", DepthApi(node, "zed_depth", clock)),
        "lidar_depthmap": LidarDepthmap("LiDAR", DepthApi(node, "lidar_obstacles", clock)),
    }
