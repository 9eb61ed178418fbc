"""Hooks of the skillset `mapping`: lidar_mapping."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from mapping_managers.hooks import AbstractLidarMappingSkill

from uav_skills.decisions import decide_mapping
from uav_skills.functional import MappingApi
from uav_skills.watched import WatchedSkill

if TYPE_CHECKING:
    from rclpy.node import Node

    from alula import Execution, SkillHooks
    from uav_skills.decisions import SkillEnd


class LidarMapping(WatchedSkill, AbstractLidarMappingSkill):  # type: ignore[misc]  # generated
    """Register scans into the map until interrupted; then write it."""

    def __init__(self, mapping: MappingApi) -> None:
        super().__init__(mapping)
        self._mapping = mapping

    def switch_on(self, execution: Execution) -> None:
        """Have the mapping node register scans."""
        self._mapping.enable(on=True, reply=functools.partial(self.on_response, execution))

    def switch_off(self) -> None:
        """Stop the registration and write the map."""
        self._mapping.enable(on=False)
        self._mapping.save()

    def heard_s(self) -> float | None:
        """When the last scan was registered."""
        return self._mapping.registered_s

    def decide(self, silent_s: float) -> SkillEnd | None:
        """End as ABORTED when no more are registered."""
        return decide_mapping(silent_s, self._mapping.lidar_fault)


def make_hooks(node: Node) -> dict[str, SkillHooks]:
    """Make the hooks of all skills of the skillset."""
    return {"lidar_mapping": LidarMapping(MappingApi(node))}
