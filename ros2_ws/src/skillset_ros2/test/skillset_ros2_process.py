"""A process that serves one of the drone's skillsets with hooks that do nothing but tell of it; for the tests that end processes.

``ALULA_TEST_SKILLSET`` names it (navigation), ``ALULA_TEST_LASTS_S`` ends each execution with its skill's first result after so long.
"""

import importlib
import os
import sys
import threading

from alula.runtime.hooks import SkillHooks
from skillset_ros2 import run_skillset

NAME = os.environ.get("ALULA_TEST_SKILLSET", "navigation")
LASTS_S = float(os.environ.get("ALULA_TEST_LASTS_S", "0"))
SKILLSET = importlib.import_module(f"{NAME}_managers.model").SKILLSET


class Telling(SkillHooks):
    def on_dispatch(self, execution):
        sys.stdout.write(f"started {execution.skill} {execution.id}\n")
        sys.stdout.flush()
        if LASTS_S:
            result = SKILLSET.skill(execution.skill).results[0].name
            threading.Timer(LASTS_S, execution.terminate, (result,)).start()

    def on_interrupt(self, execution):
        sys.stdout.write(f"stopped {execution.skill}: {execution.message}\n")
        sys.stdout.flush()


run_skillset(SKILLSET, importlib.import_module(f"{NAME}_interfaces.action"), lambda _: {skill.name: Telling() for skill in SKILLSET.skills})
