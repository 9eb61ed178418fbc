"""A world with the flying skillset, a client that is ready, and hooks that take their time."""

from __future__ import annotations

from alula.runtime.hooks import SkillHooks
from alula.runtime.local import LocalWorld
from alula_testing.runtime_models import flying_skillset


class Timed(SkillHooks):
    """Ends with DONE after a while, if it is not stopped."""

    def __init__(self, managers, duration_s: float = 1.0) -> None:
        self.managers = managers
        self.duration_s = duration_s
        self.started_s: dict[str, float] = {}
        self.stopped: list[str] = []

    def on_dispatch(self, execution) -> None:
        self.started_s[execution.id] = self.managers.clock.now_s
        self.managers.after(self.duration_s, lambda: execution.terminate("DONE", "there", {"reached": 2.5}))

    def progress(self, execution) -> float:
        return (self.managers.clock.now_s - self.started_s[execution.id]) / self.duration_s

    def on_interrupt(self, execution) -> None:
        self.stopped.append(execution.id)


def timed(managers):
    return {skill.name: Timed(managers) for skill in managers.skillset.skills}


def make(skillset=None, hooks=timed, *, authority=True, **options):
    world = LocalWorld([skillset or flying_skillset()], hooks, **options)
    client = world.client("flying")
    assert client.wait_ready(1.0)
    if authority:
        assert client.transition("sdk", "AVAILABLE").get(1.0).accepted
    return world, client
