"""A process that serves the drone's navigation with hooks that can be paused and never end by themselves."""

import navigation_interfaces.action
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from skillset_ros2 import run_skillset


class Endless(SkillHooks):
    """Runs until it is interrupted; a takeoff higher than 100 m is refused."""

    def validate(self, inputs):
        return "too high" if getattr(inputs, "height", 0.0) > 100.0 else ""

    def progress(self, execution):
        return 0.25

    def on_pause(self, execution):
        return ""

    def on_resume(self, execution):
        return ""

    def on_interrupt(self, execution):
        pass


run_skillset(SKILLSET, navigation_interfaces.action, lambda _: {skill.name: Endless() for skill in SKILLSET.skills})
