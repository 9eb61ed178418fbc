"""A process that serves the drone's navigation: a takeoff above 100 m is refused, all else can be paused and never ends by itself."""

import navigation_interfaces.action
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from skillset_ros2 import run_skillset


class Obedient(SkillHooks):
    def validate(self, inputs):
        return "too high" if getattr(inputs, "height", 0.0) > 100.0 else ""

    def progress(self, execution):
        return 0.5

    def on_pause(self, execution):
        return ""

    def on_resume(self, execution):
        return ""

    def on_interrupt(self, execution):
        """Stop at once."""


if __name__ == "__main__":
    run_skillset(SKILLSET, navigation_interfaces.action, lambda _: {skill.name: Obedient() for skill in SKILLSET.skills})
