"""The main function of the drone's skillsets."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from skillset_ros2 import run_skillset

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rclpy.node import Node

    from alula import SkillHooks


def serve(skillset: str, make_hooks: Callable[[Node], Mapping[str, SkillHooks]]) -> None:
    """Serve a skillset with the packages that were generated of its model, until SIGINT or SIGTERM."""
    model = importlib.import_module(f"{skillset}_managers.model")
    interfaces = importlib.import_module(f"{skillset}_interfaces.action")
    run_skillset(model.SKILLSET, interfaces, make_hooks, data_bindings=model.DATA_TOPICS)
