"""What a script needs of a middleware."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.handle import SkillHandle
from alula.runtime.hooks import SkillHooks

Hooks = Mapping[str, SkillHooks]


class Client(Protocol):
    """The part of the clients' API that scripts use."""

    @property
    def resources(self) -> dict[str, str]:
        """The state of every resource."""
        ...

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Ask for an execution."""
        ...


class Stage(Protocol):
    """Managers of the drone's navigation over one middleware, up before the first step; each stage serves one script."""

    engine: SkillsetEngine

    def client(self) -> Client:
        """Return a new client that is ready."""
        ...

    def transition(self, resource: str, state: str) -> tuple[bool, str, str]:
        """Take an extern transition as the functional layer does; return accepted, reason, state."""
        ...

    def set_paused(self, identifier: str, *, paused: bool) -> tuple[bool, str]:
        """Pause or resume an execution; return accepted, reason."""
        ...

    def why(self, skill: str, inputs: dict[str, Any]) -> tuple[bool, str, list[str]]:
        """Ask whether a skill could start now; return ready, reason, and the causes of the past transitions."""
        ...

    def last(self, client: Client, skill: str) -> tuple[str, str, str, str] | None:
        """Return id, outcome, result and message of the skill's last execution, as this client knows it."""
        ...

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Let time pass until the condition holds; raise when it does not within a generous time."""
        ...

    def events(self) -> list[dict[str, Any]]:
        """Return all events heard so far by a listener of its own, in order, as records."""
        ...

    def close(self) -> None:
        """End the managers; after that no hook is called any more."""
        ...


HooksFactory = Callable[[Callable[[float, Callable[[], object]], object]], Hooks]
"""Makes the hooks, given a function that runs a job after so many seconds of mission clock."""
MakeStage = Callable[[HooksFactory], Stage]
