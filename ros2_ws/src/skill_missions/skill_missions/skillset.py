"""What a mission needs of a skillset: the part of the client that the leaves use, and the client that wakes the tree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from skill_runtime.client import Client as SkillsetClient
from skill_runtime.handle import SkillHandle

NANOSECONDS = 1e9
Clock = Callable[[], int]
"""Mission clock in nanoseconds."""


class Client(Protocol):
    """A skillset."""

    @property
    def skillset(self) -> str:
        """Its name."""
        ...

    @property
    def ready(self) -> bool:
        """Tell whether it can be called."""
        ...

    @property
    def resources(self) -> Mapping[str, str]:
        """State of every resource; empty until the skillset was heard of."""
        ...

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start an execution; returns at once."""
        ...


class WakingClient:
    """A skillset's client that has the tree ticked at once when an execution ends or a resource changes."""

    def __init__(self, client: SkillsetClient, wake: Callable[[], None]) -> None:
        self.client = client
        self.skillset = client.skillset
        self._wake = wake
        client.on_change(lambda _: wake())

    @property
    def ready(self) -> bool:
        """Tell whether it can be called."""
        return self.client.ready

    @property
    def resources(self) -> Mapping[str, str]:
        """State of every resource; empty until the skillset was heard of."""
        return self.client.resources

    def start(self, skill: str, **inputs: object) -> SkillHandle:
        """Start an execution."""
        handle = self.client.start(skill, **inputs)
        handle.add_done_callback(lambda _: self._wake())
        return handle
