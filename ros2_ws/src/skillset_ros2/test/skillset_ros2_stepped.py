"""A process that serves the drone's navigation, reports its resource SDK_authority, and tells of each progress; its wall clock may be set.

SIGUSR1 ends the reports. An interruption is never done by the hooks: the managers end it after ``interrupt_timeout_s``.
"""

import signal
import sys

import navigation_interfaces.action
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from alula_testing.navigation import with_silence
from skillset_ros2 import Heartbeat, Watch, run_skillset

MODEL = with_silence(SKILLSET, "SDK_authority", 2.0)


class Telling(SkillHooks):
    def progress(self, execution):
        tell("progress")
        return execution.progress

    def on_interrupt(self, execution):
        return False


def tell(word):
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()


def hooks(node):
    heartbeat = Heartbeat(node, MODEL.name, "SDK_authority")
    signal.signal(signal.SIGUSR1, lambda *_: heartbeat.close())
    Watch(node).every(lambda: tell("look"))
    return {skill.name: Telling() for skill in MODEL.skills}


run_skillset(MODEL, navigation_interfaces.action, hooks)
