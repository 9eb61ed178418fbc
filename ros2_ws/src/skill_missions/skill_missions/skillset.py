"""What a mission needs of a skillset's client: the part of `skill_runtime`'s SkillsetClient that the leaves use."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

NANOSECONDS = 1e9
Clock = Callable[[], int]
"""Mission clock in nanoseconds."""


class Handle(Protocol):
    """One execution, as its client sees it."""

    @property
    def state(self) -> object:
        """An ExecutionState."""
        ...

    @property
    def done(self) -> bool:
        """Tell whether the execution has ended and its outcome is known."""
        ...

    @property
    def outcome(self) -> str:
        """Name of the terminal state, as TERMINATED; empty before the end."""
        ...

    @property
    def result(self) -> str:
        """Name of the result in the model, or of the precondition or invariant that refused or ended it."""
        ...

    @property
    def message(self) -> str:
        """Why, in words."""
        ...

    @property
    def progress(self) -> float:
        """How far it is, 0 to 1."""
        ...

    def interrupt(self) -> None:
        """Ask for the end; returns at once."""
        ...


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
        """State of every resource."""
        ...

    def start(self, skill: str, **inputs: object) -> Handle:
        """Start an execution; returns at once."""
        ...
