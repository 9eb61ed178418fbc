"""The resource manager's interface (paper, section 4.2): states latched, services for extern transitions and events."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.events import EngineEvent, TransitionEvent
from alula.runtime.core.records import ResourceStatus
from alula.runtime.core.replies import TransitionReply
from alula.runtime.core.sanitize import as_text
from alula.runtime.middleware import REPORTED, RESOURCE_STATES, Middleware, Reply, ResourceStates
from alula.runtime.staleness import StalenessWatch

TELL_SILENCE_NS = 1_000_000_000
"""How often it is told that a resource is silent still."""


class ResourceManager:
    """Publishes ``resource_states`` once a step and at each new reason, and serves ``transition`` and ``trigger``.

    Resources with a ``silence`` are followed on ``reported``, the heartbeat of their reporters. One whose reporter falls silent is taken
    back to its initial state, and its reason says for how long; one whose reporter was never heard of is not.
    """

    def __init__(self, middleware: Middleware, engine: SkillsetEngine, instance_id: str) -> None:
        self._middleware = middleware
        self._engine = engine
        self._instance_id = instance_id
        self._publisher = middleware.advertise(RESOURCE_STATES)
        # Kept apart from the engine's, so that each message is the state after the step that it is sent for.
        self._latest = dict(engine.resources)
        self._sequence = 0
        self._lock = threading.Lock()
        self._silences = {one.name: one for one in engine.skillset.resources if one.silence_s is not None}
        self._staleness = StalenessWatch(middleware, self._tell_silence)
        self._silence_reported: dict[str, str] = {}
        """Of each resource that is silent, the reason that was told last."""
        self._publish(middleware.now_ns())

    def serve(self) -> None:
        """Serve ``transition`` (extern transitions) and ``trigger`` (events of the model)."""
        self._middleware.serve("transition", self._transition)
        self._middleware.serve("trigger", self._trigger)
        if self._silences:
            self._middleware.subscribe(REPORTED, self._on_reported)

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the transitions of one step."""
        transitions = [event for event in events if isinstance(event, TransitionEvent)]
        if not transitions:
            return
        with self._lock:
            for event in transitions:
                self._latest[event.resource] = ResourceStatus(event.to_state, event.from_state, event.stamp_ns, event.reason)
            self._sequence = transitions[-1].sequence
            self._publish(transitions[-1].stamp_ns)

    def transition(self, resource: str, to: str, reason: str = "") -> TransitionReply:
        """Take an extern transition, or say why not.

        ``reason``: why the resource is so, in words. It is taken also where the resource is in that state already, which is no transition:
        what it is from the start has a reason, and a reason may change.
        """
        reply = self._engine.transition(resource, to, reason)
        if reason and not reply.accepted and reply.state == to:
            self._note(resource, to, as_text(reason))
        return reply

    def doubt(self, reason: str) -> None:
        """Give all resources that only skills set a reason for doubting their states; "": there is none any more."""
        owned = [one.name for one in self._engine.skillset.resources if not any(transition.extern for transition in one.transitions)]
        with self._lock:
            self._latest |= {name: replace(self._latest[name], reason=reason) for name in owned}
            if owned:
                self._publish(self._middleware.now_ns())

    def _note(self, resource: str, state: str, reason: str) -> None:
        """Publish another reason for the state that a resource is in."""
        self._engine.note(resource, state, reason)
        with self._lock:
            latest = self._latest[resource]
            if latest.state == state and latest.reason != reason:
                self._latest[resource] = replace(latest, reason=reason)
                self._publish(self._middleware.now_ns())

    def _on_reported(self, reported: ResourceStates) -> None:
        self.on_report(reported.resources)

    def on_report(self, resources: Iterable[str]) -> None:
        """Note that the reporter of these resources was heard of."""
        now_ns = self._middleware.now_ns()
        for name in self._silences.keys() & set(resources):
            self._staleness.on_sample(name, now_ns, round((self._silences[name].silence_s or 0.0) * 1e9))
            reported_silence = self._silence_reported.pop(name, None)
            if reported_silence is not None and self._engine.resources[name].reason == reported_silence:
                self._note(name, self._silences[name].initial, "")

    def expect_nothing(self) -> None:
        """Take it that no reporter will be heard of any more, which makes nothing unknown: a record has no more to say."""
        self._staleness.forget()

    def _tell_silence(self, name: str) -> None:
        """Take a silent resource back, and say for how long it was not heard of, again each second until it is."""
        silent_ns = self._staleness.silent_ns(name)
        if silent_ns is None:
            return
        reason = self._silence_reported[name] = f"not heard of for {round(silent_ns / 1e9, 1):g} s"
        self.transition(name, self._silences[name].initial, reason)
        self._middleware.at(self._middleware.now_ns() + TELL_SILENCE_NS, lambda: self._tell_silence(name))

    def _publish(self, stamp_ns: int) -> None:
        self._publisher.publish(ResourceStates(self._instance_id, self._sequence, stamp_ns, dict(self._latest)))

    def _transition(self, request: Mapping[str, Any], reply: Reply) -> None:
        reply(self.transition(request["resource"], request["to"], request["reason"]))

    def _trigger(self, request: Mapping[str, Any], reply: Reply) -> None:
        reply(self._engine.trigger(request["event"]))
