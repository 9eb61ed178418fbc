"""Functions that run until they are ended, and can be paused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from skill_runtime.core import Execution
from skill_runtime.hooks import SkillHooks


class TameHooks(SkillHooks):
    """Does nothing, as long as it is asked to."""

    def on_pause(self, execution: Execution) -> str:
        """Rest."""
        return ""

    def on_resume(self, execution: Execution) -> str:
        """Go on."""
        return ""


def tame_hooks(abstract_hooks: Mapping[str, Any]) -> dict[str, SkillHooks]:
    """Return hooks for each skill, with its own inputs."""
    return {name: type("Tame", (TameHooks,), {"inputs_type": hooks.inputs_type})() for name, hooks in abstract_hooks.items()}
