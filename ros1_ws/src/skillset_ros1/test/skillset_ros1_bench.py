"""The drone's navigation served by this process's rospy node with recording hooks, and a client of it."""

from __future__ import annotations

import itertools
import threading

import navigation_interfaces.msg
import rospy
from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET

from alula.runtime.hooks import SkillHooks
from alula_testing.recorder import Recorder
from alula_testing.waits import until
from skillset_ros1 import SkillsetClient, SkillsetManagers

SOON_S = 30.0
NUMBERS = itertools.count()


class Pausing(Recorder):
    """Can be paused only where ``acts`` says so."""

    def __init__(self, skill: str) -> None:
        super().__init__()
        self.inputs_type = ABSTRACT_HOOKS[skill].inputs_type

    def on_pause(self, execution) -> str | None:
        return self.acts["on_pause"](execution) if "on_pause" in self.acts else SkillHooks.on_pause(self, execution)

    def on_resume(self, execution) -> str | None:
        return self.acts["on_resume"](execution) if "on_resume" in self.acts else SkillHooks.on_resume(self, execution)


class Navigation:
    """Managers, hooks and client in a namespace of their own."""

    def __init__(self) -> None:
        self.namespace = f"/n{next(NUMBERS)}"
        self.hooks = {skill.name: Pausing(skill.name) for skill in SKILLSET.skills}
        self.clients: list[SkillsetClient] = []
        self.managers = SkillsetManagers(SKILLSET, navigation_interfaces.msg, lambda _: self.hooks, namespace=self.namespace)
        self.client = self.another_client()

    def another_client(self) -> SkillsetClient:
        client = SkillsetClient("navigation", namespace=self.namespace)
        self.clients.append(client)
        assert client.wait_ready(SOON_S)
        return client

    def name(self, topic: str) -> str:
        return f"{self.namespace}/navigation/{topic}"

    def service(self, kind, name: str, /, **request: object):
        return rospy.ServiceProxy(self.name(name), kind)(**request)

    def bring(self, states: dict[str, str]) -> None:
        """Take extern transitions, as the functional layer does."""
        for resource, state in states.items():
            reply = self.managers.engine.transition(resource, state)
            assert reply.accepted or reply.state == state, reply.reason

    def running(self, skill: str, **inputs: object):
        handle = self.client.start(skill, **inputs)
        until(lambda: handle.state.value == "RUNNING", f"{skill} runs, it is {handle}: {handle.message}")
        until(lambda: "on_dispatch" in self.hooks[skill].calls, "it was dispatched")
        return handle

    def fly(self):
        return self.running("goto_straight", target=(1, 2.5, 3), speed=1)

    def execution(self, handle):
        return self.managers.engine.execution(handle.id)

    def close(self) -> None:
        self.managers.close("the test is over")
        for client in self.clients:
            client.close()
        self.managers.destroy()


def on_thread(job) -> threading.Thread:
    thread = threading.Thread(target=job, daemon=True)
    thread.start()
    return thread
