"""Hooks of two of the drone's skillsets that tell of what they start and stop, for managers that are named on a command line."""

from __future__ import annotations

import sys

from mapping_managers.model import SKILLSET as MAPPING
from navigation_managers.model import SKILLSET as NAVIGATION

from alula.runtime.hooks import SkillHooks


class Telling(SkillHooks):
    """Runs until it is stopped."""

    def on_dispatch(self, execution):
        self.tell("started", execution)

    def on_interrupt(self, execution):
        self.tell("stopped", execution)

    def tell(self, what, execution):
        sys.stdout.write(f"{what} {execution.skill}: {execution.message}\n")
        sys.stdout.flush()


def mapping(_node):
    """Make the hooks of the skillset `mapping`."""
    return {skill.name: Telling() for skill in MAPPING.skills}


def navigation(node):
    """Make those of `navigation`, beside a callback that raises, once, after the time that the parameter ``raises_s`` says."""
    raises_s = float(node.declare_parameter("raises_s", 0.0).value)

    def fail() -> None:
        node.destroy_timer(timer)
        raise ValueError("a callback of navigation went wrong")

    timer = node.create_timer(raises_s, fail) if raises_s else None
    return {skill.name: Telling() for skill in NAVIGATION.skills}
