"""A process that serves the drone's navigation and tells of each progress; its wall clock may be set.

An interruption is never done by the hooks: the managers end it after ``~interrupt_timeout_s``.
"""

import sys

import navigation_interfaces.msg
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from alula_testing.navigation import with_silence
from skillset_ros1 import run_skillset

MODEL = with_silence(SKILLSET, "SDK_authority", 2.0)


class Telling(SkillHooks):
    def progress(self, execution):
        sys.stdout.write("progress\n")
        sys.stdout.flush()
        return execution.progress

    def on_interrupt(self, execution):
        return False


run_skillset(MODEL, navigation_interfaces.msg, lambda _: {skill.name: Telling() for skill in MODEL.skills})
