"""The README's example: hooks written once, without a ROS API, that run in either world."""

import threading

from skill_runtime.hooks import SkillHooks


class Pretending(SkillHooks):
    """Ends each skill with its first result, half a second after its start."""

    def __init__(self, result):
        self.result = result

    def on_dispatch(self, execution):
        threading.Timer(0.5, lambda: execution.terminate(self.result)).start()


def make_hooks(managers):
    return {skill.name: Pretending(skill.results[0].name) for skill in managers.skillset.skills}
