"""Managers and clients over rospy, on a master of this process's own."""

from __future__ import annotations

import itertools
import json
from typing import Any

import navigation_interfaces.msg
import rospy
from navigation_managers.model import SKILLSET
from skillset_interfaces.msg import Event
from skillset_interfaces.srv import SetPaused, SetPausedRequest, Transition, TransitionRequest, Why, WhyRequest

from alula_testing.traces import live
from alula_testing.traces.stage import Client, HooksFactory
from skillset_ros1 import SkillsetClient, SkillsetManagers, call_and_wait

NUMBERS = itertools.count()


class Ros1Stage(live.LiveStage):
    """One namespace."""

    def __init__(self, make_hooks: HooksFactory) -> None:
        super().__init__()
        self._namespace = f"/play{next(NUMBERS)}"
        self._managers = SkillsetManagers(SKILLSET, navigation_interfaces.msg, lambda _: make_hooks(live.after), namespace=self._namespace)
        self.engine = self._managers.engine
        self._subscriber = rospy.Subscriber(f"{self._managers.place}/events", Event, self.listener.hear)
        self._clients: list[SkillsetClient] = []

    def client(self) -> Client:
        """Return a new client that is ready."""
        client = SkillsetClient(SKILLSET.name, namespace=self._namespace)
        self._clients.append(client)
        assert client.wait_ready(live.TIMEOUT_S)
        return client

    def transition(self, resource: str, state: str) -> tuple[bool, str, str]:
        """Call the service."""
        request = TransitionRequest(resource=resource, to=state)
        reply = call_and_wait(f"{self._managers.place}/transition", Transition, request, timeout_s=live.TIMEOUT_S)
        return reply.accepted, reply.reason, reply.state

    def set_paused(self, identifier: str, *, paused: bool) -> tuple[bool, str]:
        """Call the service."""
        request = SetPausedRequest(id=identifier, paused=paused)
        reply = call_and_wait(f"{self._managers.place}/pause", SetPaused, request, timeout_s=live.TIMEOUT_S)
        return reply.accepted, reply.reason

    def why(self, skill: str, inputs: dict[str, Any]) -> tuple[bool, str, list[str]]:
        """Call the service."""
        request = WhyRequest(skill=skill, inputs_json=json.dumps(inputs) if inputs else "")
        reply = call_and_wait(f"{self._managers.place}/why", Why, request, timeout_s=live.TIMEOUT_S)
        return reply.ready, reply.reason, [transition.cause for transition in reply.history]

    def close(self) -> None:
        """End the managers."""
        self._managers.close("the play is over")
        self._subscriber.unregister()
        for client in self._clients:
            client.close()
        self._managers.destroy()
