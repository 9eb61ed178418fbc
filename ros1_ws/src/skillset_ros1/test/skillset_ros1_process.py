"""A process that serves the drone's navigation with hooks that do nothing but tell of it; for the tests that end processes."""

import sys

import navigation_interfaces.msg
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from skillset_ros1 import run_skillset


class Telling(SkillHooks):
    def on_interrupt(self, execution):
        sys.stdout.write(f"stopped {execution.skill}: {execution.message}\n")
        sys.stdout.flush()


run_skillset(SKILLSET, navigation_interfaces.msg, lambda _: {skill.name: Telling() for skill in SKILLSET.skills})
