"""Managers and clients without middleware, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from navigation_managers.model import SKILLSET

from alula.runtime.core.events import EngineEvent, event_record
from alula.runtime.local import LocalWorld
from alula_testing.traces.stage import Client, HooksFactory

TIMEOUT_S = 10.0


class NoneStage:
    """One world."""

    def __init__(self, make_hooks: HooksFactory) -> None:
        self._world = LocalWorld()
        self._managers = self._world.serve(SKILLSET, lambda managers: make_hooks(managers.after))
        self.engine = self._managers.engine
        self._heard: list[dict[str, Any]] = []
        self._world.client(SKILLSET.name).on_event(self._hear)

    def _hear(self, event: EngineEvent) -> None:
        self._heard.append(event_record(event))

    def client(self) -> Client:
        """Return a new client that is ready."""
        client = self._world.client(SKILLSET.name)
        assert client.wait_ready(TIMEOUT_S)
        return client

    def transition(self, resource: str, state: str) -> tuple[bool, str, str]:
        """Take an extern transition."""
        reply = self._managers.transition(resource, state)
        return reply.accepted, reply.reason, reply.state

    def set_paused(self, identifier: str, *, paused: bool) -> tuple[bool, str]:
        """Pause or resume."""
        reply = self.engine.pause(identifier) if paused else self.engine.resume(identifier)
        return reply.accepted, reply.reason

    def why(self, skill: str, inputs: dict[str, Any]) -> tuple[bool, str, list[str]]:
        """Ask the engine."""
        answer = self.engine.why(skill, SimpleNamespace(**inputs) if inputs else None)
        return answer.ready, answer.reason, [event.cause for event in answer.history]

    def last(self, client: Client, skill: str) -> tuple[str, str, str, str] | None:
        """Ask the engine."""
        last = self.engine.skills[skill].last
        return None if last is None else (last.id, last.state.value, last.result, last.message)

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Let virtual time pass."""
        assert self._world.run_until(condition, timeout_s=TIMEOUT_S), what

    def events(self) -> list[dict[str, Any]]:
        """Return what was heard."""
        return list(self._heard)

    def close(self) -> None:
        """End the managers."""
        self._managers.close("the play is over")
        self._world.run_for(1.0)
